#include "cuda/emulated/emulated_make.hpp"
#include "cuda/kernels/derivative_catalogue.hpp"

namespace stiction::cuda {

DerivativeKernels emulated_derivative_kernels(Precision precision) {
  return precision == Precision::f32 ? derivative_kernels<MakeEmulatedKernel, float>()
                                     : derivative_kernels<MakeEmulatedKernel, double>();
}

}  // namespace stiction::cuda
