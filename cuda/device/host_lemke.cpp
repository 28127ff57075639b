#include "core/algorithm/solver/lemke/lemke.hpp"
#include "cuda/device/host_make.hpp"

namespace stiction::cuda {

SolverKernels host_lemke_kernels() {
  return solver_kernels<MakeHostKernel, Lemke>();
}

}  // namespace stiction::cuda
