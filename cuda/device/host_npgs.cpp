#include "core/algorithm/solver/npgs.hpp"
#include "cuda/device/host_make.hpp"

namespace stiction::cuda {

SolverKernels host_npgs_kernels() {
  return solver_kernels<MakeHostKernel, Npgs>();
}

}  // namespace stiction::cuda
