#include "core/algorithm/solver/nsgs.hpp"

#include "cuda/runtime/cuda_launch.cuh"

namespace stiction::cuda {

SolverKernels cuda_nsgs_kernels() {
  return solver_kernels<MakeCudaKernel, Nsgs>();
}

}  // namespace stiction::cuda
