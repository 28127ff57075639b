#include "cuda/machine/articulated_machine.hpp"
#include "cuda/machine/body_machine.hpp"
#include "cuda/machine/contact_machine.hpp"
#include "cuda/machine/derivative_machine.hpp"
#include "cuda/machine/jacobian_machine.hpp"
#include "cuda/machine/memory_limits.hpp"
#include "cuda/machine/warm_start_machine.hpp"
#include "cuda/machine/world_machine.hpp"
#include "cuda/native/cuda_api.hpp"
#include "cuda/native/cuda_device.hpp"
#include "stiction/error.hpp"

// Device::cuda(): the machines of a device over the CUDA runtime. A build without CUDA has core/machine/no_cuda.cpp
// instead.
namespace stiction {

namespace {

/// \throws Error(no_device) with the reason, and the alternatives.
std::shared_ptr<cuda::CudaApi> open_device(int ordinal, const char* without) {
  std::string reason;
  const int count = cuda::device_count(reason);
  if (count > 0) reason = cuda::why_unusable(ordinal, count);
  if (!reason.empty()) throw Error(ErrorCode::no_device, reason + "; " + without);
  return std::make_shared<cuda::CudaApi>(ordinal);
}

}  // namespace

std::unique_ptr<ContactMachine> make_cuda_contact_machine(int ordinal) {
  return std::make_unique<cuda::DeviceContactMachine>(open_device(ordinal, "solve on the cpu"));
}

std::unique_ptr<BodyMachine> make_cuda_body_machine(int ordinal) {
  return std::make_unique<cuda::DeviceBodyMachine>(open_device(ordinal, "solve bodies on the cpu"), false);
}

template <class Real>
std::unique_ptr<WorldMachine<Real>> make_cuda_world_machine(int ordinal, const WorldModelView<Real>& model,
                                                            Offset env_count, const WorldOptions& options) {
  return std::make_unique<cuda::DeviceWorldMachine<Real>>(open_device(ordinal, "step the world on the cpu"), model,
                                                          env_count, options);
}

template std::unique_ptr<WorldMachine<float>> make_cuda_world_machine(int, const WorldModelView<float>&, Offset,
                                                                      const WorldOptions&);
template std::unique_ptr<WorldMachine<double>> make_cuda_world_machine(int, const WorldModelView<double>&, Offset,
                                                                       const WorldOptions&);

template <class Real>
std::unique_ptr<ArticulatedMachine<Real>> make_cuda_articulated_machine(int ordinal, const ArticulatedJob<Real>& job,
                                                                        Offset env_count) {
  std::shared_ptr<cuda::DeviceApi> api = open_device(ordinal, "step robots on the cpu");
  const Offset most_bytes = cuda::most_scratch_bytes(api->facts());
  return cuda::make_device_articulated_machine(std::move(api), job, env_count, most_bytes);
}

template std::unique_ptr<ArticulatedMachine<float>> make_cuda_articulated_machine(int, const ArticulatedJob<float>&,
                                                                                  Offset);
template std::unique_ptr<ArticulatedMachine<double>> make_cuda_articulated_machine(int, const ArticulatedJob<double>&,
                                                                                   Offset);

template <class Real>
std::unique_ptr<WarmStartMachine<Real>> make_cuda_warm_start_machine(int ordinal, const WarmStartCapacity& capacity) {
  return std::make_unique<cuda::DeviceWarmStartMachine<Real>>(open_device(ordinal, "keep the store on the cpu"),
                                                              capacity, false);
}

template std::unique_ptr<WarmStartMachine<float>> make_cuda_warm_start_machine(int, const WarmStartCapacity&);
template std::unique_ptr<WarmStartMachine<double>> make_cuda_warm_start_machine(int, const WarmStartCapacity&);

template <class Real>
std::unique_ptr<JacobianMachine<Real>> make_cuda_jacobian_machine(int ordinal, const JacobianCapacity& capacity,
                                                                  FactorUse use, bool by_newton) {
  return std::make_unique<cuda::DeviceJacobianMachine<Real>>(open_device(ordinal, "solve the batch on the cpu"),
                                                             capacity, use, by_newton);
}

template std::unique_ptr<JacobianMachine<float>> make_cuda_jacobian_machine(int, const JacobianCapacity&, FactorUse,
                                                                            bool);
template std::unique_ptr<JacobianMachine<double>> make_cuda_jacobian_machine(int, const JacobianCapacity&, FactorUse,
                                                                             bool);

std::unique_ptr<DerivativeMachine> make_cuda_derivative_machine(int ordinal, const Capacity& capacity,
                                                                const DerivativeOptions& options) {
  return std::make_unique<cuda::DeviceDerivativeMachine>(open_device(ordinal, "differentiate on the cpu"), capacity,
                                                         options, false);
}

}  // namespace stiction
