#include "core/machine/articulated_machine.hpp"
#include "core/machine/body_machine.hpp"
#include "core/machine/contact_machine.hpp"
#include "core/machine/derivative_machine.hpp"
#include "core/machine/jacobian_machine.hpp"
#include "core/machine/warm_start_machine.hpp"
#include "core/machine/world_machine.hpp"
#include "stiction/error.hpp"

namespace stiction {

namespace {
constexpr const char* kNotBuilt =
    "this build has no emulated device, which is for tests: configure with -DSTICTION_EMULATED_DEVICE=ON, or use "
    "Device::cpu(), which gives the same bits";
}

std::unique_ptr<ContactMachine> make_emulated_contact_machine() {
  throw Error(ErrorCode::unsupported, kNotBuilt);
}

std::unique_ptr<DerivativeMachine> make_emulated_derivative_machine(const Capacity&, const DerivativeOptions&) {
  throw Error(ErrorCode::unsupported, kNotBuilt);
}

std::unique_ptr<BodyMachine> make_emulated_body_machine() {
  throw Error(ErrorCode::unsupported, kNotBuilt);
}

template <class Real>
std::unique_ptr<WarmStartMachine<Real>> make_emulated_warm_start_machine(const WarmStartCapacity&) {
  throw Error(ErrorCode::unsupported, kNotBuilt);
}
template std::unique_ptr<WarmStartMachine<float>> make_emulated_warm_start_machine(const WarmStartCapacity&);
template std::unique_ptr<WarmStartMachine<double>> make_emulated_warm_start_machine(const WarmStartCapacity&);

template <class Real>
std::unique_ptr<JacobianMachine<Real>> make_emulated_jacobian_machine(const JacobianCapacity&, FactorUse, bool) {
  throw Error(ErrorCode::unsupported, kNotBuilt);
}
template std::unique_ptr<JacobianMachine<float>> make_emulated_jacobian_machine(const JacobianCapacity&, FactorUse,
                                                                                bool);
template std::unique_ptr<JacobianMachine<double>> make_emulated_jacobian_machine(const JacobianCapacity&, FactorUse,
                                                                                 bool);

template <class Real>
std::unique_ptr<WorldMachine<Real>> make_emulated_world_machine(const WorldModelView<Real>&, Offset,
                                                                const WorldOptions&) {
  throw Error(ErrorCode::unsupported, kNotBuilt);
}
template std::unique_ptr<WorldMachine<float>> make_emulated_world_machine(const WorldModelView<float>&, Offset,
                                                                          const WorldOptions&);
template std::unique_ptr<WorldMachine<double>> make_emulated_world_machine(const WorldModelView<double>&, Offset,
                                                                           const WorldOptions&);

template <class Real>
std::unique_ptr<ArticulatedMachine<Real>> make_emulated_articulated_machine(const ArticulatedJob<Real>&, Offset) {
  throw Error(ErrorCode::unsupported, kNotBuilt);
}
template std::unique_ptr<ArticulatedMachine<float>> make_emulated_articulated_machine(const ArticulatedJob<float>&,
                                                                                      Offset);
template std::unique_ptr<ArticulatedMachine<double>> make_emulated_articulated_machine(const ArticulatedJob<double>&,
                                                                                       Offset);

DeviceReport emulated_report() {
  return {Device::emulated(), false, "emulated", kNotBuilt};
}

}  // namespace stiction
