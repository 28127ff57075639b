#include "cuda/emulated/emulated_make.hpp"
#include "cuda/kernels/derivative_catalogue.hpp"

namespace stiction::cuda {

namespace {

template <class Real>
DerivativeKernels all_derivative_kernels() {
  return {derivative_kernels<MakeEmulatedKernel, Real>(), relaxed_kernels<MakeEmulatedKernel, Real>(),
          unrolled_kernel<MakeEmulatedKernel, Real>()};
}

}  // namespace

DerivativeKernels emulated_derivative_kernels(Precision precision) {
  return precision == Precision::f32 ? all_derivative_kernels<float>() : all_derivative_kernels<double>();
}

}  // namespace stiction::cuda
