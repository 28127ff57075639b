#include "cuda/emulated/emulated_kernels.hpp"

#include "cuda/emulated/emulated_make.hpp"

namespace stiction::cuda {

SolverKernels emulated_pgs_kernels();
SolverKernels emulated_npgs_kernels();
SolverKernels emulated_jacobi_kernels();
SolverKernels emulated_apgd_kernels();
SolverKernels emulated_nsgs_kernels();
SolverKernels emulated_admm_kernels();
SolverKernels emulated_newton_kernels();
SolverKernels emulated_lemke_kernels();
SolverKernels emulated_ipm_kernels();
SolverKernels emulated_subspace_kernels();
BodyKernels emulated_body_kernels();
WorldKernels emulated_world_kernels(Precision precision);
NewtonBodyKernels emulated_newton_body_kernels();

const KernelCatalogue& emulated_kernels() {
  static const KernelCatalogue catalogue{
      {emulated_pgs_kernels(), emulated_npgs_kernels(), emulated_jacobi_kernels(), emulated_apgd_kernels(),
       emulated_nsgs_kernels(), emulated_admm_kernels(), emulated_newton_kernels(), emulated_lemke_kernels(),
       emulated_ipm_kernels(), emulated_subspace_kernels()},
      {emulated_kernel<AnswerTrivial<float>>("answer_trivial"),
       emulated_kernel<AnswerTrivial<double>>("answer_trivial")},
      {emulated_kernel<ChooseEnvironments<float>>("choose"), emulated_kernel<ChooseEnvironments<double>>("choose")},
      plan_kernels<MakeEmulatedKernel>(),
      {warm_start_kernels<MakeEmulatedKernel, float>(), warm_start_kernels<MakeEmulatedKernel, double>()},
      emulated_body_kernels(),
      emulated_newton_body_kernels(),
      {jacobian_kernels<MakeEmulatedKernel, float>(), jacobian_kernels<MakeEmulatedKernel, double>()},
      {emulated_world_kernels(Precision::f32), emulated_world_kernels(Precision::f64)}};
  return catalogue;
}

}  // namespace stiction::cuda
