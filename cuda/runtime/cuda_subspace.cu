#include "core/algorithm/solver/subspace.hpp"

#include "cuda/runtime/cuda_launch.cuh"

namespace stiction::cuda {

SolverKernels cuda_subspace_kernels() {
  return solver_kernels<MakeCudaKernel, Subspace>();
}

}  // namespace stiction::cuda
