#include "cuda/runtime/cuda_kernels.hpp"
#include "cuda/runtime/cuda_launch.cuh"

namespace stiction::cuda {

BodyKernels cuda_body_kernels() {
  return body_kernels<MakeCudaKernel>();
}

}  // namespace stiction::cuda
