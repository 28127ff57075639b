#include "core/algorithm/solver/pgs.hpp"

#include "cpu_fallback/pack_driver.hpp"

namespace stiction::inline STICTION_ISA {

cpu::KernelSet pgs_kernels() {
  return kernel_set<Pgs>();
}

}  // namespace stiction::inline STICTION_ISA
