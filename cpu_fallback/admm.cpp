#include "core/body/admm_body.hpp"

#include "cpu_fallback/pack_driver.hpp"

namespace stiction::inline STICTION_ISA {

cpu::KernelSet admm_kernels() {
  return kernel_set<Admm>();
}

}  // namespace stiction::inline STICTION_ISA
