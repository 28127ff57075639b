#include "core/algorithm/solver/apgd.hpp"

#include "cpu_fallback/pack_driver.hpp"

namespace stiction::inline STICTION_ISA {

cpu::KernelSet apgd_kernels() {
  return kernel_set<Apgd>();
}

}  // namespace stiction::inline STICTION_ISA
