#include "cuda/native/cuda_kernels.hpp"
#include "cuda/native/cuda_launch.cuh"

namespace stiction::cuda {

BodyKernels cuda_body_kernels() {
  return body_kernels<MakeCudaKernel>();
}

}  // namespace stiction::cuda
