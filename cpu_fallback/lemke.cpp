#include "core/algorithm/solver/lemke/lemke.hpp"

#include "cpu_fallback/pack_driver.hpp"

namespace stiction::inline STICTION_ISA {

cpu::KernelSet lemke_kernels() {
  return kernel_set<Lemke>();
}

}  // namespace stiction::inline STICTION_ISA
