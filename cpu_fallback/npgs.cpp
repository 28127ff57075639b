#include "core/algorithm/solver/npgs.hpp"

#include "cpu_fallback/pack_driver.hpp"

namespace stiction::inline STICTION_ISA {

cpu::KernelSet npgs_kernels() {
  return kernel_set<Npgs>();
}

}  // namespace stiction::inline STICTION_ISA
