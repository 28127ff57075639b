#include "cuda/emulated/emulated_device.hpp"
#include "cuda/machine/articulated_machine.hpp"
#include "cuda/machine/body_machine.hpp"
#include "cuda/machine/contact_machine.hpp"
#include "cuda/machine/derivative_machine.hpp"
#include "cuda/machine/jacobian_machine.hpp"
#include "cuda/machine/memory_limits.hpp"
#include "cuda/machine/warm_start_machine.hpp"
#include "cuda/machine/world_machine.hpp"

// Device::emulated(): the machines of a device over launches that threads of the CPU carry out. A build without tests
// has core/machine/no_emulated.cpp instead.
namespace stiction {

std::unique_ptr<ContactMachine> make_emulated_contact_machine() {
  return std::make_unique<cuda::DeviceContactMachine>(cuda::shared_emulated_device());
}

DeviceReport emulated_report() {
  return {Device::emulated(), true, "the GPU's kernels, run by threads of the CPU (for tests)", ""};
}

std::unique_ptr<BodyMachine> make_emulated_body_machine() {
  return std::make_unique<cuda::DeviceBodyMachine>(cuda::shared_emulated_device(), true);
}

template <class Real>
std::unique_ptr<WorldMachine<Real>> make_emulated_world_machine(const WorldModelView<Real>& model, Offset env_count,
                                                                const WorldOptions& options) {
  return std::make_unique<cuda::DeviceWorldMachine<Real>>(cuda::shared_emulated_device(), model, env_count, options);
}

template std::unique_ptr<WorldMachine<float>> make_emulated_world_machine(const WorldModelView<float>&, Offset,
                                                                          const WorldOptions&);
template std::unique_ptr<WorldMachine<double>> make_emulated_world_machine(const WorldModelView<double>&, Offset,
                                                                           const WorldOptions&);

template <class Real>
std::unique_ptr<ArticulatedMachine<Real>> make_emulated_articulated_machine(const ArticulatedJob<Real>& job,
                                                                            Offset env_count) {
  std::shared_ptr<cuda::DeviceApi> api = cuda::shared_emulated_device();
  const Offset most_bytes = cuda::most_scratch_bytes(api->facts());
  return cuda::make_device_articulated_machine(std::move(api), job, env_count, most_bytes);
}

template std::unique_ptr<ArticulatedMachine<float>> make_emulated_articulated_machine(const ArticulatedJob<float>&,
                                                                                      Offset);
template std::unique_ptr<ArticulatedMachine<double>> make_emulated_articulated_machine(const ArticulatedJob<double>&,
                                                                                       Offset);

template <class Real>
std::unique_ptr<WarmStartMachine<Real>> make_emulated_warm_start_machine(const WarmStartCapacity& capacity) {
  return std::make_unique<cuda::DeviceWarmStartMachine<Real>>(cuda::shared_emulated_device(), capacity, true);
}

template std::unique_ptr<WarmStartMachine<float>> make_emulated_warm_start_machine(const WarmStartCapacity&);
template std::unique_ptr<WarmStartMachine<double>> make_emulated_warm_start_machine(const WarmStartCapacity&);

template <class Real>
std::unique_ptr<JacobianMachine<Real>> make_emulated_jacobian_machine(const JacobianCapacity& capacity, FactorUse use,
                                                                      bool by_newton) {
  return std::make_unique<cuda::DeviceJacobianMachine<Real>>(cuda::shared_emulated_device(), capacity, use, by_newton);
}

template std::unique_ptr<JacobianMachine<float>> make_emulated_jacobian_machine(const JacobianCapacity&, FactorUse,
                                                                                bool);
template std::unique_ptr<JacobianMachine<double>> make_emulated_jacobian_machine(const JacobianCapacity&, FactorUse,
                                                                                 bool);

std::unique_ptr<DerivativeMachine> make_emulated_derivative_machine(const Capacity& capacity,
                                                                    const DerivativeOptions& options) {
  return std::make_unique<cuda::DeviceDerivativeMachine>(cuda::shared_emulated_device(), capacity, options, true);
}

}  // namespace stiction
