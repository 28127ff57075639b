#include "core/algorithm/solver/jacobi.hpp"

#include "cpu_fallback/pack_driver.hpp"

namespace stiction::inline STICTION_ISA {

cpu::KernelSet jacobi_kernels() {
  return kernel_set<Jacobi>();
}

}  // namespace stiction::inline STICTION_ISA
