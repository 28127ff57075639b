#include "core/body/npgs_body.hpp"

#include "cuda/launch.cuh"

namespace stiction::cuda {

KernelSet npgs_kernels() {
  return kernel_set<Npgs>();
}

}  // namespace stiction::cuda
