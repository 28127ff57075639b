#include "cuda/kernels/derivative_catalogue.hpp"
#include "cuda/native/cuda_kernels.hpp"
#include "cuda/native/cuda_launch.cuh"

namespace stiction::cuda {

KernelRef cuda_unrolled_kernel(Precision precision) {
  return precision == Precision::f32 ? unrolled_kernel<MakeCudaKernel, float>()
                                     : unrolled_kernel<MakeCudaKernel, double>();
}

}  // namespace stiction::cuda
