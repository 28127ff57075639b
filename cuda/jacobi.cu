#include "core/body/jacobi_body.hpp"

#include "cuda/launch.cuh"

namespace stiction::cuda {

KernelSet jacobi_kernels() {
  return kernel_set<Jacobi>();
}

}  // namespace stiction::cuda
