#pragma once

#include <functional>
#include <memory>
#include <string>

#include "cuda/api/memory.hpp"
#include "stiction/solver.hpp"
#include "tools/gpu_first/json_line.hpp"

namespace stiction::gpu_first {

/// The device that is checked.
class Target {
 public:
  Target() = default;
  Target(const Target&) = delete;
  Target& operator=(const Target&) = delete;
  virtual ~Target() = default;

  /// As the public interface names it.
  [[nodiscard]] virtual Device device() const = 0;
  [[nodiscard]] virtual std::shared_ptr<cuda::DeviceApi> api() const = 0;
  /// Returns true if there is a GPU, whose times mean something.
  [[nodiscard]] virtual bool is_native() const = 0;
  /// Returns true if the kernel was compiled: a pack for few minutes leaves some out.
  [[nodiscard]] virtual bool carries(const cuda::KernelRef&) const { return true; }
  /// Writes the device's and its driver's description of themselves.
  virtual void describe(JsonLine& line) const = 0;
  /// Captures the work that `queue` queues on the stream. The result launches it once more on that stream.
  virtual std::function<void()> capture(cuda::StreamHandle stream, const std::function<void()>& queue) = 0;
};

/// Returns true if all kernels of the solver were compiled; for auto, those of its fallback chain.
bool carries(const Target& target, SolverKind solver);

/// A GPU, by its number. Null if this build has no CUDA. \throws Error(no_device) with the reason
std::unique_ptr<Target> make_cuda_target(int ordinal);
/// The device that the CPU emulates, with its own kernels or with those that STICTION_EMULATED_KERNELS names.
std::unique_ptr<Target> make_emulated_target();

/// Times that the assumptions behind the kernels' design rest on, as they are measured. Does nothing without CUDA.
void measure_basics(const std::function<void(const std::string& name, double value, const std::string& unit)>& report);

}  // namespace stiction::gpu_first
