#include "core/algorithm/solver/admm/admm.hpp"

#include "cpu_fallback/pack_driver.hpp"

namespace stiction::inline STICTION_ISA {

cpu::KernelSet admm_kernels() {
  return kernel_set<Admm>();
}

}  // namespace stiction::inline STICTION_ISA
