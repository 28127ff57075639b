#include "core/body/apgd_body.hpp"

#include "cuda/launch.cuh"

namespace stiction::cuda {

KernelSet apgd_kernels() {
  return kernel_set<Apgd>();
}

}  // namespace stiction::cuda
