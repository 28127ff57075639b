#include "core/algorithm/solver/subspace.hpp"
#include "cuda/device/host_make.hpp"

namespace stiction::cuda {

SolverKernels host_subspace_kernels() {
  return solver_kernels<MakeHostKernel, Subspace>();
}

}  // namespace stiction::cuda
