#include "cuda/native/cuda_device.hpp"

#include "core/machine/contact_machine.hpp"
#include "cuda/native/cuda_check.hpp"
#include "cuda/native/cuda_kernels.hpp"

namespace stiction {

namespace cuda {

namespace {

/// Name and meaning of an error, which is cleared so that no later call finds it.
std::string explain(cudaError_t error) {
  cudaGetLastError();
  return std::string(cudaGetErrorName(error)) + " (" + cudaGetErrorString(error) + ")";
}

}  // namespace

DeviceGuard::DeviceGuard(int ordinal) {
  STICTION_CUDA_TRY(cudaGetDevice(&before_));
  STICTION_CUDA_TRY(cudaSetDevice(ordinal));
}

DeviceGuard::~DeviceGuard() {
  cudaSetDevice(before_);
}

int device_count(std::string& reason) {
  // Without a driver the call leaves its argument as it was.
  int count = 0;
  const cudaError_t error = cudaGetDeviceCount(&count);
  if (error == cudaSuccess && count > 0) return count;
  if (error == cudaSuccess) {
    reason = "no CUDA device: the driver reports none";
    return 0;
  }
  int driver = 0;
  const bool has_driver = cudaDriverGetVersion(&driver) == cudaSuccess && driver > 0;
  reason = "no CUDA device: " + explain(error) + (has_driver ? "" : "; no NVIDIA driver is installed");
  return 0;
}

std::string why_unusable(int ordinal, int count) {
  if (ordinal < 0 || ordinal >= count)
    return "cuda:" + std::to_string(ordinal) + " is not there: this machine has " + std::to_string(count) +
           (count == 1 ? " CUDA device, cuda:0" : " CUDA devices, cuda:0 to cuda:" + std::to_string(count - 1));
  int before = 0;
  cudaGetDevice(&before);
  cudaError_t error = cudaSetDevice(ordinal);
  if (error == cudaSuccess) error = probe_kernel_image();
  const std::string reason =
      error == cudaSuccess ? "" : "cuda:" + std::to_string(ordinal) + " cannot be used: " + explain(error);
  cudaSetDevice(before);
  cudaGetLastError();
  return reason;
}

}  // namespace cuda

std::vector<DeviceReport> cuda_reports() {
  std::string reason;
  const int count = cuda::device_count(reason);
  if (count == 0) return {{Device::cuda(0), false, "cuda", reason}};
  std::vector<DeviceReport> reports;
  for (int ordinal = 0; ordinal < count; ++ordinal) {
    cudaDeviceProp properties{};
    const bool known = cudaGetDeviceProperties(&properties, ordinal) == cudaSuccess;
    reason = cuda::why_unusable(ordinal, count);
    reports.push_back({Device::cuda(ordinal), reason.empty(), known ? properties.name : "cuda", reason});
  }
  return reports;
}

}  // namespace stiction
