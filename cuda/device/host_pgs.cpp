#include "core/algorithm/solver/pgs.hpp"
#include "cuda/device/host_make.hpp"

namespace stiction::cuda {

SolverKernels host_pgs_kernels() {
  return solver_kernels<MakeHostKernel, Pgs>();
}

}  // namespace stiction::cuda
