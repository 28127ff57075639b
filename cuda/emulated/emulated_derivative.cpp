#include "cuda/emulated/emulated_make.hpp"
#include "cuda/kernels/derivative_catalogue.hpp"

namespace stiction::cuda {

DerivativeKernels emulated_derivative_kernels(Precision precision) {
  return precision == Precision::f32 ? all_derivative_kernels<MakeEmulatedKernel, float>()
                                     : all_derivative_kernels<MakeEmulatedKernel, double>();
}

}  // namespace stiction::cuda
