#include "core/algorithm/solver/pgs.hpp"
#include "cuda/emulated/emulated_make.hpp"

namespace stiction::cuda {

SolverKernels emulated_pgs_kernels() {
  return solver_kernels<MakeEmulatedKernel, Pgs>();
}

}  // namespace stiction::cuda
