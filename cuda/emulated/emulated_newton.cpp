#include "core/algorithm/solver/newton/newton.hpp"
#include "cuda/emulated/emulated_make.hpp"

namespace stiction::cuda {

SolverKernels emulated_newton_kernels() {
  return solver_kernels<MakeEmulatedKernel, Newton>();
}

}  // namespace stiction::cuda
