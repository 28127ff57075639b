#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "cli/gpu_meter.hpp"
#include "cli/json_text.hpp"
#include "cli/quantiles.hpp"
#include "stiction/thread_meter.hpp"
#include "stiction/world.hpp"

namespace stiction::cli {

/// Everything `stiction step` reports, gathered once and printed as text and as JSON.
struct StepReport {
  std::string scene, device, device_name;
  std::string solver, preconditioner;  ///< the latter of newton alone
  std::string law;                     ///< of contacts
  std::string blocks;                  ///< of contacts in a sweep
  Precision precision = Precision::f64;
  std::int64_t environments = 0, steps = 0, bodies = 0;
  std::int64_t resumed_at = 0;  ///< of the steps, those that a checkpoint had
  std::uint64_t seed = 0;
  double dt = 0, tolerance = 0;
  Index iterations = 0;
  int threads = 0;
  double wall = 0;  ///< seconds of all steps
  double cpu = 0;   ///< processor seconds of all steps
  WorldSeconds seconds;
  ThreadUse thread_use;  ///< in all steps
  GpuUse gpu;            ///< from the first step to the last
  double quality = 1;
  std::optional<Quantiles<double>> residual;
  std::array<std::int64_t, kEnvCodeCount> codes{};
  std::int64_t contacts = 0, overflows = 0;
  double energy_begin = 0, energy_end = 0, largest_rise = 0, momentum_drift = 0, deepest = 0;
  std::uint64_t hash = 0;

  /// Environment-steps per second.
  [[nodiscard]] double rate() const;
  /// Share of the steps' time that the solve took.
  [[nodiscard]] double solver_share() const;
  /// Processor time over the time of all threads.
  [[nodiscard]] double utilisation() const;
};

/// Returns the exit status: kExitMissed if an environment-step was not finite or not valid.
int exit_status(const StepReport& report);
/// As to_json gives it to dump().
Json json_of(const StepReport& report);
/// Keys: docs/reference/cli.md. Closed by a line feed.
std::string to_json(const StepReport& report);
/// The table a person reads.
std::string to_text(const StepReport& report);

}  // namespace stiction::cli
