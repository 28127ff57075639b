#include "core/algorithm/solver/apgd.hpp"
#include "cuda/emulated/emulated_make.hpp"

namespace stiction::cuda {

SolverKernels emulated_apgd_kernels() {
  return solver_kernels<MakeEmulatedKernel, Apgd>();
}

}  // namespace stiction::cuda
