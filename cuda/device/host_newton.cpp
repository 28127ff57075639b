#include "core/algorithm/solver/newton/newton.hpp"
#include "cuda/device/host_make.hpp"

namespace stiction::cuda {

SolverKernels host_newton_kernels() {
  return solver_kernels<MakeHostKernel, Newton>();
}

}  // namespace stiction::cuda
