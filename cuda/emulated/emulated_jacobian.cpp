#include "cuda/emulated/emulated_make.hpp"
#include "cuda/kernels/jacobian_catalogue.hpp"

namespace stiction::cuda {

JacobianKernels emulated_jacobian_kernels(Precision precision) {
  return precision == Precision::f32 ? jacobian_kernels<MakeEmulatedKernel, float>()
                                     : jacobian_kernels<MakeEmulatedKernel, double>();
}

}  // namespace stiction::cuda
