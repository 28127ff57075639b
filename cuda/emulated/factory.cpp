#include "cuda/device_backend.hpp"
#include "cuda/device_bodies.hpp"
#include "cuda/device_jacobian.hpp"
#include "cuda/device_warm_start.hpp"
#include "cuda/device_world.hpp"
#include "cuda/emulated/emulated_device.hpp"

// Device::emulated(): the machines of a device over launches that threads of the CPU carry out. A build without tests
// has core/machine/no_emulated.cpp instead.
namespace stiction {

std::unique_ptr<Backend> make_emulated_backend() {
  return std::make_unique<cuda::DeviceBackend>(cuda::shared_emulated_device());
}

DeviceReport emulated_report() {
  return {Device::emulated(), true, "the GPU's kernels, run by threads of the CPU (for tests)", ""};
}

std::unique_ptr<BodyMachine> make_emulated_bodies() {
  return std::make_unique<cuda::DeviceBodies>(cuda::shared_emulated_device(), true);
}

template <class Real>
std::unique_ptr<WorldMachine<Real>> make_emulated_world(const WorldModelView<Real>& model, Offset env_count,
                                                        const WorldOptions& options) {
  return std::make_unique<cuda::DeviceWorld<Real>>(cuda::shared_emulated_device(), model, env_count, options);
}

template std::unique_ptr<WorldMachine<float>> make_emulated_world(const WorldModelView<float>&, Offset,
                                                                  const WorldOptions&);
template std::unique_ptr<WorldMachine<double>> make_emulated_world(const WorldModelView<double>&, Offset,
                                                                   const WorldOptions&);

template <class Real>
std::unique_ptr<WarmStartMachine<Real>> make_emulated_warm_start(const WarmStartCapacity& capacity) {
  return std::make_unique<cuda::DeviceWarmStart<Real>>(cuda::shared_emulated_device(), capacity, true);
}

template std::unique_ptr<WarmStartMachine<float>> make_emulated_warm_start(const WarmStartCapacity&);
template std::unique_ptr<WarmStartMachine<double>> make_emulated_warm_start(const WarmStartCapacity&);

template <class Real>
std::unique_ptr<JacobianMachine<Real>> make_emulated_jacobian(const JacobianCapacity& capacity, FactorUse use,
                                                              bool by_newton) {
  return std::make_unique<cuda::DeviceJacobian<Real>>(cuda::shared_emulated_device(), capacity, use, by_newton);
}

template std::unique_ptr<JacobianMachine<float>> make_emulated_jacobian(const JacobianCapacity&, FactorUse, bool);
template std::unique_ptr<JacobianMachine<double>> make_emulated_jacobian(const JacobianCapacity&, FactorUse, bool);

}  // namespace stiction
