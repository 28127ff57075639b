#include "core/algorithm/solver/ipm/ipm.hpp"

#include "cuda/runtime/cuda_launch.cuh"

namespace stiction::cuda {

SolverKernels cuda_ipm_kernels() {
  return solver_kernels<MakeCudaKernel, Ipm>();
}

}  // namespace stiction::cuda
