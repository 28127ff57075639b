#include "core/algorithm/solver/lemke/lemke.hpp"

#include "cuda/runtime/cuda_launch.cuh"

namespace stiction::cuda {

SolverKernels cuda_lemke_kernels() {
  return solver_kernels<MakeCudaKernel, Lemke>();
}

}  // namespace stiction::cuda
