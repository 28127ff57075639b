#include "cuda/device_bodies.hpp"
#include "cuda/runtime/cuda_api.hpp"
#include "cuda/runtime/cuda_device.hpp"
#include "stiction/error.hpp"

namespace stiction {

std::unique_ptr<BodyMachine> make_cuda_bodies(int ordinal) {
  std::string reason;
  const int count = cuda::device_count(reason);
  if (count > 0) reason = cuda::why_unusable(ordinal, count);
  if (!reason.empty()) throw Error(ErrorCode::no_device, reason + "; solve bodies on the cpu");
  return std::make_unique<cuda::DeviceBodies>(std::make_shared<cuda::CudaApi>(ordinal), false);
}

}  // namespace stiction
