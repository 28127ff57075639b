#include "cuda/native/cuda_kernels.hpp"

namespace stiction::cuda {

namespace {

DerivativeKernels all_derivative_kernels(Precision precision) {
  return {cuda_derivative_kernels(precision), cuda_relaxed_kernels(precision), cuda_unrolled_kernel(precision),
          cuda_lanes_kernel(precision)};
}

VelocityKernels all_velocity_kernels(Precision precision) {
  VelocityKernels kernels;
  add_cuda_velocity_kernels(precision, kernels);
  add_cuda_velocity_part_kernels(precision, kernels);
  return kernels;
}

}  // namespace

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
      {all_velocity_kernels(Precision::f32), all_velocity_kernels(Precision::f64)},
      {cuda_world_kernels(Precision::f32), cuda_world_kernels(Precision::f64)},
      {all_derivative_kernels(Precision::f32), all_derivative_kernels(Precision::f64)}};
  return catalogue;
}

}  // namespace stiction::cuda
