#include "core/algorithm/solver/admm/admm.hpp"

#include "cuda/runtime/cuda_launch.cuh"

namespace stiction::cuda {

SolverKernels cuda_admm_kernels() {
  return solver_kernels<MakeCudaKernel, Admm>();
}

}  // namespace stiction::cuda
