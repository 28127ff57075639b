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
    "this build has no CUDA machine: configure with nvcc on the PATH (scripts/get_cuda.sh fetches one) and "
    "-DSTICTION_ENABLE_CUDA=ON";
}

std::unique_ptr<ContactMachine> make_cuda_contact_machine(int) {
  throw Error(ErrorCode::unsupported, kNotBuilt);
}

template <class Real>
std::unique_ptr<WarmStartMachine<Real>> make_cuda_warm_start_machine(int, const WarmStartCapacity&) {
  throw Error(ErrorCode::unsupported, kNotBuilt);
}
template std::unique_ptr<WarmStartMachine<float>> make_cuda_warm_start_machine(int, const WarmStartCapacity&);
template std::unique_ptr<WarmStartMachine<double>> make_cuda_warm_start_machine(int, const WarmStartCapacity&);

template <class Real>
std::unique_ptr<JacobianMachine<Real>> make_cuda_jacobian_machine(int, const JacobianCapacity&, FactorUse, bool) {
  throw Error(ErrorCode::unsupported, kNotBuilt);
}
template std::unique_ptr<JacobianMachine<float>> make_cuda_jacobian_machine(int, const JacobianCapacity&, FactorUse,
                                                                            bool);
template std::unique_ptr<JacobianMachine<double>> make_cuda_jacobian_machine(int, const JacobianCapacity&, FactorUse,
                                                                             bool);

std::unique_ptr<DerivativeMachine> make_cuda_derivative_machine(int, const Capacity&, const DerivativeOptions&) {
  throw Error(ErrorCode::unsupported, kNotBuilt);
}

std::unique_ptr<BodyMachine> make_cuda_body_machine(int) {
  throw Error(ErrorCode::unsupported, kNotBuilt);
}

template <class Real>
std::unique_ptr<WorldMachine<Real>> make_cuda_world_machine(int, const WorldModelView<Real>&, Offset,
                                                            const WorldOptions&) {
  throw Error(ErrorCode::unsupported, kNotBuilt);
}
template std::unique_ptr<WorldMachine<float>> make_cuda_world_machine(int, const WorldModelView<float>&, Offset,
                                                                      const WorldOptions&);
template std::unique_ptr<WorldMachine<double>> make_cuda_world_machine(int, const WorldModelView<double>&, Offset,
                                                                       const WorldOptions&);

template <class Real>
std::unique_ptr<ArticulatedMachine<Real>> make_cuda_articulated_machine(int, const ArticulatedJob<Real>&, Offset) {
  throw Error(ErrorCode::unsupported, kNotBuilt);
}
template std::unique_ptr<ArticulatedMachine<float>> make_cuda_articulated_machine(int, const ArticulatedJob<float>&,
                                                                                  Offset);
template std::unique_ptr<ArticulatedMachine<double>> make_cuda_articulated_machine(int, const ArticulatedJob<double>&,
                                                                                   Offset);

std::vector<DeviceReport> cuda_reports() {
  return {{Device::cuda(0), false, "cuda", kNotBuilt}};
}

}  // namespace stiction
