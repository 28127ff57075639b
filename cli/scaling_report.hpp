#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "stiction/thread_meter.hpp"
#include "stiction/types.hpp"

namespace stiction::cli {

/// One number of threads.
struct ScalingPoint {
  int threads = 1;
  std::int64_t environments = 0;
  double seconds = 0;      ///< of the shortest run
  ThreadUse use;           ///< in that run
  std::uint64_t hash = 0;  ///< over the environments that all points have
};

/// Points in the order of their threads. Each is compared with the first.
struct ScalingSeries {
  std::vector<ScalingPoint> points;

  /// Environments per second over those of the first point; none where no time was measured.
  [[nodiscard]] std::optional<double> speedup(const ScalingPoint& point) const;
  /// The speed-up over how many times the first point's threads there are; 1 is perfect. This holds for strong
  /// scaling, the same environments, as for weak scaling, where environments grow with the threads.
  [[nodiscard]] std::optional<double> efficiency(const ScalingPoint& point) const;
};

/// Share of a run outside of sections, in which one thread worked (Amdahl's serial part).
std::optional<double> serial_share(const ScalingPoint& point);

/// Everything `stiction scaling` reports.
struct ScalingReport {
  std::string target, solver;
  Precision precision = Precision::f64;
  bool is_scene = false;
  std::int64_t steps = 0;  ///< of a scene
  int cores = 0;           ///< processors that the system names
  int repeat = 1;
  ScalingSeries strong;
  std::optional<ScalingSeries> weak;

  /// Returns true if every point has the first one's bits.
  [[nodiscard]] bool bits_agree() const;
};

/// The JSON of docs/reference/cli.md, closed by a line feed.
std::string to_json(const ScalingReport& report);
/// The tables a person reads.
std::string to_text(const ScalingReport& report);

}  // namespace stiction::cli
