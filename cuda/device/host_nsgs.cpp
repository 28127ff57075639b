#include "core/algorithm/solver/nsgs.hpp"
#include "cuda/device/host_make.hpp"

namespace stiction::cuda {

SolverKernels host_nsgs_kernels() {
  return solver_kernels<MakeHostKernel, Nsgs>();
}

}  // namespace stiction::cuda
