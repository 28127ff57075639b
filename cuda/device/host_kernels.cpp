#include "cuda/device/host_kernels.hpp"

#include "cuda/device/host_make.hpp"

namespace stiction::cuda {

SolverKernels host_pgs_kernels();
SolverKernels host_npgs_kernels();
SolverKernels host_jacobi_kernels();
SolverKernels host_apgd_kernels();
SolverKernels host_nsgs_kernels();
SolverKernels host_admm_kernels();
SolverKernels host_newton_kernels();
SolverKernels host_lemke_kernels();
SolverKernels host_ipm_kernels();
SolverKernels host_subspace_kernels();
BodyKernels host_body_kernels();
WorldKernels host_world_kernels(Precision precision);
NewtonBodyKernels host_newton_body_kernels();

const KernelCatalogue& host_kernels() {
  static const KernelCatalogue catalogue{
      {host_pgs_kernels(), host_npgs_kernels(), host_jacobi_kernels(), host_apgd_kernels(), host_nsgs_kernels(),
       host_admm_kernels(), host_newton_kernels(), host_lemke_kernels(), host_ipm_kernels(), host_subspace_kernels()},
      {host_kernel<AnswerSettled<float>>("answer_settled"), host_kernel<AnswerSettled<double>>("answer_settled")},
      {host_kernel<ChooseEnvironments<float>>("choose"), host_kernel<ChooseEnvironments<double>>("choose")},
      plan_kernels<MakeHostKernel>(),
      {warm_start_kernels<MakeHostKernel, float>(), warm_start_kernels<MakeHostKernel, double>()},
      host_body_kernels(),
      host_newton_body_kernels(),
      {jacobian_kernels<MakeHostKernel, float>(), jacobian_kernels<MakeHostKernel, double>()},
      {host_world_kernels(Precision::f32), host_world_kernels(Precision::f64)}};
  return catalogue;
}

}  // namespace stiction::cuda
