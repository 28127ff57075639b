#include "cuda/native/cuda_kernels.hpp"
#include "cuda/native/cuda_launch.cuh"

namespace stiction::cuda {

NewtonBodyKernels cuda_newton_body_kernels() {
  return newton_body_kernels<MakeCudaKernel>();
}

}  // namespace stiction::cuda
