#pragma once

#include <string>

#include "cuda/machine/engine.hpp"
#include "tests/support/machines/device_batch.hpp"
#include "tools/gpu_first/report.hpp"

namespace stiction::gpu_first {

/// Microseconds of one launch: the median of some, and the least.
struct Time {
  double median = 0, least = 0;
};
/// Time of the work that `queue` queues on the stream, as a graph launched `repeats` times. It is queued once before.
Time time_graph(Target& target, cuda::StreamHandle stream, int repeats, const std::function<void()>& queue);

/// Nanoseconds as a person reads them.
std::string brief(double nanoseconds);

/// A batch in a device's memory and an engine that solves it, to be timed as a graph.
class Timed {
 public:
  Timed(Target& target, const ContactBatch<float>& batch, const SolverOptions& options);

  /// `with_plan`: planning included.
  Time solve(int repeats, bool with_plan);

 private:
  void queue(bool is_planned);

  Target& target_;
  std::shared_ptr<cuda::DeviceApi> api_;
  const ContactBatch<float>& batch_;
  SolverOptions options_;
  cuda::Engine engine_;
  cuda::Stream stream_;
  test::DeviceBatch<float> there_;
};

/// Repeats of one measurement: on a device that the CPU stands in for, one.
inline int repeats(const Report& report, int on_a_gpu = 10) {
  return report.target() != nullptr && report.target()->is_native() ? on_a_gpu : 1;
}

}  // namespace stiction::gpu_first
