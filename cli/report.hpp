#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "cli/gpu_meter.hpp"
#include "cli/quantiles.hpp"
#include "cli/stopwatch.hpp"
#include "stiction/io.hpp"
#include "stiction/solver.hpp"

namespace stiction::cli {

struct Seconds {
  double load = 0, plan = 0, solve = 0;
  ThreadUse threads;  ///< use of threads in `solve`

  void take(Timing timing) {
    solve = timing.seconds;
    threads = std::move(timing.threads);
  }
};

/// Everything `stiction solve` reports, gathered once and printed as text and as JSON.
struct SolveReport {
  std::string file, device, device_name;
  SolverOptions options;
  Law law = Law::convex;
  Precision precision = Precision::f64;
  int threads = 0;                         ///< 0: not a matter of CPU threads
  std::string form = "matrix";             ///< form that was solved: matrix, jacobian or bodies
  std::string solver;                      ///< its name
  std::string preconditioner{};            ///< of bodies' Newton's method, empty: none
  bool asynchronous = false;               ///< whether threads waited for no colour
  int pyramid = 0;                         ///< sides of the pyramids that were solved; 0: the cones themselves
  std::optional<io::SolutionShard> shard;  ///< which part of the file's environments was solved, where not all were
  Offset environments = 0, rows = 0, cones = 0;
  Seconds seconds;
  GpuUse gpu;  ///< while batches were planned and solved
  std::optional<Quantiles<std::int32_t>> iterations;
  std::optional<Quantiles<double>> residual;
  std::optional<Quantiles<std::int32_t>> islands;  ///< that were solved apart
  std::array<Offset, kEnvCodeCount> codes{};
  std::array<Offset, kEnvFlagCount> flags{};
  std::map<SolverKind, Offset> answered;  ///< environments by the solver that answered
  Offset unconverged = 0;
  std::uint64_t hash = 0;

  /// Fills iterations, residual, islands, codes, flags, answered and unconverged.
  void count(std::span<const EnvStatus> status);
};

/// The JSON of design section 4 (keys: docs/reference/cli.md), closed by a line feed.
std::string to_json(const SolveReport& report);
/// The table a person reads.
std::string to_text(const SolveReport& report);

/// 16 hexadecimal digits.
std::string hex(std::uint64_t hash);
/// The precision of a --precision option. \throws Error(invalid_argument) for any but f32 and f64.
Precision precision_from_option(const std::string& text);
/// "cpu", "cuda:0".
std::string to_string(Device device);
/// "min 1.0e-07  median ...", or "-" for no values.
std::string quantile_text(const std::optional<Quantiles<double>>& values);
std::string quantile_text(const std::optional<Quantiles<std::int32_t>>& values);

}  // namespace stiction::cli
