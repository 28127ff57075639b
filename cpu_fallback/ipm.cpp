#include "core/algorithm/solver/ipm/ipm.hpp"

#include "cpu_fallback/pack_driver.hpp"

namespace stiction::inline STICTION_ISA {

cpu::KernelSet ipm_kernels() {
  return kernel_set<Ipm>();
}

}  // namespace stiction::inline STICTION_ISA
