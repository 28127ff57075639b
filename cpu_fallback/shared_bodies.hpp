#pragma once

#include "core/block/block.hpp"
#include "core/body/shared_bodies.hpp"

namespace stiction::inline STICTION_ISA {

STICTION_SHARED_BODIES(extern, SerialBlock)

}  // namespace stiction::inline STICTION_ISA
