#pragma once

#include "core/base/macros.hpp"
#include "cpu_fallback/tables/derivative_kernels.hpp"

namespace stiction::inline STICTION_ISA {

/// Pulling environments of contacts back side by side, or nothing where this instruction set has no packs.
cpu::VjpPackKernelSet vjp_pack_kernels();

}  // namespace stiction::inline STICTION_ISA
