#include "core/algorithm/solver/npgs.hpp"
#include "cuda/emulated/emulated_make.hpp"

namespace stiction::cuda {

SolverKernels emulated_npgs_kernels() {
  return solver_kernels<MakeEmulatedKernel, Npgs>();
}

}  // namespace stiction::cuda
