#include "core/algorithm/solver/lemke/lemke.hpp"
#include "cuda/emulated/emulated_make.hpp"

namespace stiction::cuda {

SolverKernels emulated_lemke_kernels() {
  return solver_kernels<MakeEmulatedKernel, Lemke>();
}

}  // namespace stiction::cuda
