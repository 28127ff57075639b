#include "core/algorithm/solver/ipm/ipm.hpp"
#include "cuda/device/host_make.hpp"

namespace stiction::cuda {

SolverKernels host_ipm_kernels() {
  return solver_kernels<MakeHostKernel, Ipm>();
}

}  // namespace stiction::cuda
