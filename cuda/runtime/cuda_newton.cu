#include "core/algorithm/solver/newton/newton.hpp"

#include "cuda/runtime/cuda_launch.cuh"

namespace stiction::cuda {

SolverKernels cuda_newton_kernels() {
  return solver_kernels<MakeCudaKernel, Newton>();
}

}  // namespace stiction::cuda
