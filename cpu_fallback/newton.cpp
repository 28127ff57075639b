#include "core/algorithm/solver/newton/newton.hpp"

#include "cpu_fallback/pack_driver.hpp"

namespace stiction::inline STICTION_ISA {

cpu::KernelSet newton_kernels() {
  return kernel_set<Newton>();
}

}  // namespace stiction::inline STICTION_ISA
