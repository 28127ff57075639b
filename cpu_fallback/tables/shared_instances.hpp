#pragma once

#include "core/algorithm/driver/shared_instances.hpp"
#include "core/team/team.hpp"

namespace stiction::inline STICTION_ISA {

STICTION_SHARED_BODIES(extern, SerialTeam)

}  // namespace stiction::inline STICTION_ISA
