#include "core/algorithm/solver/nsgs.hpp"
#include "cuda/emulated/emulated_make.hpp"

namespace stiction::cuda {

SolverKernels emulated_nsgs_kernels() {
  return solver_kernels<MakeEmulatedKernel, Nsgs>();
}

}  // namespace stiction::cuda
