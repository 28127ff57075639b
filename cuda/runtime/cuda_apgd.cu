#include "core/algorithm/solver/apgd.hpp"

#include "cuda/runtime/cuda_launch.cuh"

namespace stiction::cuda {

SolverKernels cuda_apgd_kernels() {
  return solver_kernels<MakeCudaKernel, Apgd>();
}

}  // namespace stiction::cuda
