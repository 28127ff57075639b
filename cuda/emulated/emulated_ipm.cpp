#include "core/algorithm/solver/ipm/ipm.hpp"
#include "cuda/emulated/emulated_make.hpp"

namespace stiction::cuda {

SolverKernels emulated_ipm_kernels() {
  return solver_kernels<MakeEmulatedKernel, Ipm>();
}

}  // namespace stiction::cuda
