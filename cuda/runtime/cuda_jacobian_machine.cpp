#include "cuda/device_jacobian.hpp"
#include "cuda/runtime/cuda_api.hpp"
#include "cuda/runtime/cuda_device.hpp"
#include "stiction/error.hpp"

namespace stiction {

template <class Real>
std::unique_ptr<JacobianMachine<Real>> make_cuda_jacobian(int ordinal, const JacobianCapacity& capacity, FactorUse use,
                                                          bool by_newton) {
  std::string reason;
  const int count = cuda::device_count(reason);
  if (count > 0) reason = cuda::why_unusable(ordinal, count);
  if (!reason.empty()) throw Error(ErrorCode::no_device, reason + "; solve the batch on the cpu");
  return std::make_unique<cuda::DeviceJacobian<Real>>(std::make_shared<cuda::CudaApi>(ordinal), capacity, use,
                                                      by_newton);
}

template std::unique_ptr<JacobianMachine<float>> make_cuda_jacobian(int, const JacobianCapacity&, FactorUse, bool);
template std::unique_ptr<JacobianMachine<double>> make_cuda_jacobian(int, const JacobianCapacity&, FactorUse, bool);

}  // namespace stiction
