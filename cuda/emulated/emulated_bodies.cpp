#include "cuda/emulated/emulated_make.hpp"

namespace stiction::cuda {

BodyKernels emulated_body_kernels() {
  return body_kernels<MakeEmulatedKernel>();
}

NewtonBodyKernels emulated_newton_body_kernels() {
  return newton_body_kernels<MakeEmulatedKernel>();
}

}  // namespace stiction::cuda
