#include "cuda/native/cuda_kernels.hpp"

namespace stiction::cuda {

const KernelCatalogue& cuda_kernels() {
  static const KernelCatalogue catalogue{
      cuda_solver_kernels(),
      {cuda_trivial_kernel(Precision::f32), cuda_trivial_kernel(Precision::f64)},
      {cuda_choose_kernel(Precision::f32), cuda_choose_kernel(Precision::f64)},
      cuda_plan_kernels(),
      {cuda_warm_start_kernels(Precision::f32), cuda_warm_start_kernels(Precision::f64)},
      cuda_body_kernels(),
      cuda_newton_body_kernels(),
      {cuda_jacobian_kernels(Precision::f32), cuda_jacobian_kernels(Precision::f64)},
      {cuda_velocity_kernels(Precision::f32), cuda_velocity_kernels(Precision::f64)},
      {cuda_world_kernels(Precision::f32), cuda_world_kernels(Precision::f64)},
      {cuda_derivative_kernels(Precision::f32), cuda_derivative_kernels(Precision::f64)}};
  return catalogue;
}

}  // namespace stiction::cuda
