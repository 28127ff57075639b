#include "core/algorithm/solver/jacobi.hpp"
#include "cuda/emulated/emulated_make.hpp"

namespace stiction::cuda {

SolverKernels emulated_jacobi_kernels() {
  return solver_kernels<MakeEmulatedKernel, Jacobi>();
}

}  // namespace stiction::cuda
