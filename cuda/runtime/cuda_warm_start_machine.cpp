#include "cuda/device_warm_start.hpp"
#include "cuda/runtime/cuda_api.hpp"
#include "cuda/runtime/cuda_device.hpp"
#include "stiction/error.hpp"

namespace stiction {

template <class Real>
std::unique_ptr<WarmStartMachine<Real>> make_cuda_warm_start(int ordinal, const WarmStartCapacity& capacity) {
  std::string reason;
  const int count = cuda::device_count(reason);
  if (count > 0) reason = cuda::why_unusable(ordinal, count);
  if (!reason.empty()) throw Error(ErrorCode::no_device, reason + "; keep the store on the cpu");
  return std::make_unique<cuda::DeviceWarmStart<Real>>(std::make_shared<cuda::CudaApi>(ordinal), capacity, false);
}

template std::unique_ptr<WarmStartMachine<float>> make_cuda_warm_start(int, const WarmStartCapacity&);
template std::unique_ptr<WarmStartMachine<double>> make_cuda_warm_start(int, const WarmStartCapacity&);

}  // namespace stiction
