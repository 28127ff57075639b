#include "cuda/kernels/derivative_catalogue.hpp"
#include "cuda/native/cuda_kernels.hpp"
#include "cuda/native/cuda_launch.cuh"

namespace stiction::cuda {

DerivativePair cuda_relaxed_kernels(Precision precision) {
  return precision == Precision::f32 ? relaxed_kernels<MakeCudaKernel, float>()
                                     : relaxed_kernels<MakeCudaKernel, double>();
}

}  // namespace stiction::cuda
