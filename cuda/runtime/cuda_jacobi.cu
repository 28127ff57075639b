#include "core/algorithm/solver/jacobi.hpp"

#include "cuda/runtime/cuda_launch.cuh"

namespace stiction::cuda {

SolverKernels cuda_jacobi_kernels() {
  return solver_kernels<MakeCudaKernel, Jacobi>();
}

}  // namespace stiction::cuda
