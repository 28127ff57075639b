#include "cuda/device_world.hpp"
#include "cuda/runtime/cuda_api.hpp"
#include "cuda/runtime/cuda_device.hpp"
#include "stiction/error.hpp"

namespace stiction {

template <class Real>
std::unique_ptr<WorldMachine<Real>> make_cuda_world(int ordinal, const WorldModelView<Real>& model, Offset env_count,
                                                    const WorldOptions& options) {
  std::string reason;
  const int count = cuda::device_count(reason);
  if (count > 0) reason = cuda::why_unusable(ordinal, count);
  if (!reason.empty()) throw Error(ErrorCode::no_device, reason + "; step the world on the cpu");
  return std::make_unique<cuda::DeviceWorld<Real>>(std::make_shared<cuda::CudaApi>(ordinal), model, env_count, options);
}

template std::unique_ptr<WorldMachine<float>> make_cuda_world(int, const WorldModelView<float>&, Offset,
                                                              const WorldOptions&);
template std::unique_ptr<WorldMachine<double>> make_cuda_world(int, const WorldModelView<double>&, Offset,
                                                               const WorldOptions&);

}  // namespace stiction
