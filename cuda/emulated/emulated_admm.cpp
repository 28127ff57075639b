#include "core/algorithm/solver/admm/admm.hpp"
#include "cuda/emulated/emulated_make.hpp"

namespace stiction::cuda {

SolverKernels emulated_admm_kernels() {
  return solver_kernels<MakeEmulatedKernel, Admm>();
}

}  // namespace stiction::cuda
