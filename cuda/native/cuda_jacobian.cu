#include "cuda/kernels/jacobian_catalogue.hpp"
#include "cuda/native/cuda_kernels.hpp"
#include "cuda/native/cuda_launch.cuh"

namespace stiction::cuda {

JacobianKernels cuda_jacobian_kernels(Precision precision) {
  return precision == Precision::f32 ? jacobian_kernels<MakeCudaKernel, float>()
                                     : jacobian_kernels<MakeCudaKernel, double>();
}

}  // namespace stiction::cuda
