#include "cuda/native/cuda_kernels.hpp"
#include "cuda/native/cuda_launch.cuh"

namespace stiction::cuda {

WorldKernels cuda_world_kernels(Precision precision) {
  return precision == Precision::f32 ? world_kernels<MakeCudaKernel, float>() : world_kernels<MakeCudaKernel, double>();
}

}  // namespace stiction::cuda
