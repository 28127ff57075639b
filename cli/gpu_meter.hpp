#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>

#include "cli/json_text.hpp"
#include "stiction/solver.hpp"

namespace stiction::cli {

/// Use of a GPU.
struct GpuUse {
  std::optional<double> share;  ///< of the time in which kernels ran, of any program: mean of the samples, 0 to 1
  int samples = 0;
  std::string reason;  ///< why there is no share; empty where there is one
};

/// Location of NVIDIA's libraries, and the sampling of a meter.
struct GpuMeterOptions {
  std::string nvml = "libnvidia-ml.so.1";
  std::string driver = "libcuda.so.1";
  /// A sample of NVML is of the last 1/6 s to 1 s. One that is older than the meter by less tells of what was before.
  std::chrono::milliseconds first{1000};
  std::chrono::milliseconds every{100};
};

/// Measures the use of a GPU by NVML, from its construction to end(). Libraries are loaded here and nowhere else, so
/// nothing is linked with them. A missing part gives a reason, and never an exception.
class GpuMeter {
 public:
  explicit GpuMeter(Device device, const GpuMeterOptions& options = {});
  ~GpuMeter();
  GpuMeter(const GpuMeter&) = delete;
  GpuMeter& operator=(const GpuMeter&) = delete;

  /// Ends sampling. A second call returns the result of the first.
  GpuUse end();

 private:
  class Sampler;
  std::unique_ptr<Sampler> sampler_;
  GpuUse use_;
};

/// The share, or null.
Json json_of(const GpuUse& use);
/// "83.1 % of 24 samples", or the reason.
std::string gpu_use_text(const GpuUse& use);

}  // namespace stiction::cli
