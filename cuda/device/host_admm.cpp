#include "core/algorithm/solver/admm/admm.hpp"
#include "cuda/device/host_make.hpp"

namespace stiction::cuda {

SolverKernels host_admm_kernels() {
  return solver_kernels<MakeHostKernel, Admm>();
}

}  // namespace stiction::cuda
