#include "core/algorithm/solver/nsgs.hpp"

#include "cpu_fallback/pack_driver.hpp"

namespace stiction::inline STICTION_ISA {

cpu::KernelSet nsgs_kernels() {
  return kernel_set<Nsgs>();
}

}  // namespace stiction::inline STICTION_ISA
