#include "core/body/lemke_body.hpp"
#include "cuda/device/host_make.hpp"

namespace stiction::cuda {

SolverKernels host_lemke_kernels() {
  return solver_kernels<MakeHostKernel, Lemke>();
}

}  // namespace stiction::cuda
