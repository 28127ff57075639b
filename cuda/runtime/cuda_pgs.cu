#include "core/algorithm/solver/pgs.hpp"

#include "cuda/runtime/cuda_launch.cuh"

namespace stiction::cuda {

SolverKernels cuda_pgs_kernels() {
  return solver_kernels<MakeCudaKernel, Pgs>();
}

}  // namespace stiction::cuda
