#include "cuda/device/host_make.hpp"

namespace stiction::cuda {

BodyKernels host_body_kernels() {
  return body_kernels<MakeHostKernel>();
}

NewtonBodyKernels host_newton_body_kernels() {
  return newton_body_kernels<MakeHostKernel>();
}

}  // namespace stiction::cuda
