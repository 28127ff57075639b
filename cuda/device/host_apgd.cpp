#include "core/algorithm/solver/apgd.hpp"
#include "cuda/device/host_make.hpp"

namespace stiction::cuda {

SolverKernels host_apgd_kernels() {
  return solver_kernels<MakeHostKernel, Apgd>();
}

}  // namespace stiction::cuda
