#include "core/body/pgs_body.hpp"

#include "cuda/launch.cuh"

namespace stiction::cuda {

KernelSet pgs_kernels() {
  return kernel_set<Pgs>();
}

}  // namespace stiction::cuda
