#include "cuda/native/cuda_kernels.hpp"
#include "cuda/native/cuda_launch.cuh"

namespace stiction::cuda {

WarmStartKernels cuda_warm_start_kernels(Precision precision) {
  return precision == Precision::f32 ? warm_start_kernels<MakeCudaKernel, float>()
                                     : warm_start_kernels<MakeCudaKernel, double>();
}

}  // namespace stiction::cuda
