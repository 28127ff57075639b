#pragma once

#include "core/base/macros.hpp"
#include "cpu_fallback/tables/derivative_kernels.hpp"

namespace stiction::inline STICTION_ISA {

/// Derivatives of environments of contacts side by side, or nothing where this instruction set has no packs.
cpu::ModePackKernelSet mode_pack_kernels();

}  // namespace stiction::inline STICTION_ISA
