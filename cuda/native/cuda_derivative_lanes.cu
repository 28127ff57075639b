#include "cuda/kernels/derivative_catalogue.hpp"
#include "cuda/native/cuda_kernels.hpp"
#include "cuda/native/cuda_launch.cuh"

namespace stiction::cuda {

KernelRef cuda_lanes_kernel(Precision precision) {
  return precision == Precision::f32 ? lanes_kernel<MakeCudaKernel, float>() : lanes_kernel<MakeCudaKernel, double>();
}

}  // namespace stiction::cuda
