#include "core/algorithm/solver/jacobi.hpp"
#include "cuda/device/host_make.hpp"

namespace stiction::cuda {

SolverKernels host_jacobi_kernels() {
  return solver_kernels<MakeHostKernel, Jacobi>();
}

}  // namespace stiction::cuda
