#include "core/algorithm/solver/subspace.hpp"
#include "cuda/emulated/emulated_make.hpp"

namespace stiction::cuda {

SolverKernels emulated_subspace_kernels() {
  return solver_kernels<MakeEmulatedKernel, Subspace>();
}

}  // namespace stiction::cuda
