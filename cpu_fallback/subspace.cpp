#include "core/algorithm/solver/subspace.hpp"

#include "cpu_fallback/pack_driver.hpp"

namespace stiction::inline STICTION_ISA {

cpu::KernelSet subspace_kernels() {
  return kernel_set<Subspace>();
}

}  // namespace stiction::inline STICTION_ISA
