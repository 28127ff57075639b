#include "cuda/kernels/velocity_catalogue.hpp"
#include "cuda/native/cuda_kernels.hpp"
#include "cuda/native/cuda_launch.cuh"

namespace stiction::cuda {

VelocityKernels cuda_velocity_kernels(Precision precision) {
  return precision == Precision::f32 ? velocity_kernels<MakeCudaKernel, float>()
                                     : velocity_kernels<MakeCudaKernel, double>();
}

}  // namespace stiction::cuda
