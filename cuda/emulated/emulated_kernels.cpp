#include "cuda/emulated/emulated_kernels.hpp"

#include "cuda/emulated/emulated_make.hpp"

namespace stiction::cuda {

BodyKernels emulated_body_kernels();
DerivativeKernels emulated_derivative_kernels(Precision precision);
JacobianKernels emulated_jacobian_kernels(Precision precision);
VelocityKernels emulated_velocity_kernels(Precision precision);
WorldKernels emulated_world_kernels(Precision precision);
NewtonBodyKernels emulated_newton_body_kernels();

const KernelCatalogue& emulated_kernels() {
  static const KernelCatalogue catalogue{
      emulated_solver_kernels(),
      {emulated_kernel<AnswerTrivial<float>>("answer_trivial"),
       emulated_kernel<AnswerTrivial<double>>("answer_trivial")},
      {emulated_kernel<ChooseEnvironments<float>>("choose"), emulated_kernel<ChooseEnvironments<double>>("choose")},
      plan_kernels<MakeEmulatedKernel>(),
      {warm_start_kernels<MakeEmulatedKernel, float>(), warm_start_kernels<MakeEmulatedKernel, double>()},
      emulated_body_kernels(),
      emulated_newton_body_kernels(),
      {emulated_jacobian_kernels(Precision::f32), emulated_jacobian_kernels(Precision::f64)},
      {emulated_velocity_kernels(Precision::f32), emulated_velocity_kernels(Precision::f64)},
      {emulated_world_kernels(Precision::f32), emulated_world_kernels(Precision::f64)},
      {emulated_derivative_kernels(Precision::f32), emulated_derivative_kernels(Precision::f64)}};
  return catalogue;
}

}  // namespace stiction::cuda
