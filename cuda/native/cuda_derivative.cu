#include "cuda/kernels/derivative_catalogue.hpp"
#include "cuda/native/cuda_kernels.hpp"
#include "cuda/native/cuda_launch.cuh"

namespace stiction::cuda {

DerivativePair cuda_derivative_kernels(Precision precision) {
  return precision == Precision::f32 ? derivative_kernels<MakeCudaKernel, float>()
                                     : derivative_kernels<MakeCudaKernel, double>();
}

}  // namespace stiction::cuda
