#include "core/algorithm/solver/npgs.hpp"

#include "cuda/runtime/cuda_launch.cuh"

namespace stiction::cuda {

SolverKernels cuda_npgs_kernels() {
  return solver_kernels<MakeCudaKernel, Npgs>();
}

}  // namespace stiction::cuda
