#pragma once

#include "core/algorithm/driver/shared_instances.hpp"
#include "core/team/team.hpp"
#include "cuda/emulated/emulated_team.hpp"

/// What the library has compiled of loading, recording and judging, on one lane and on the emulated device's teams.
/// Builds of packs alone have neither.
namespace stiction::inline STICTION_ISA {

#if !defined(STICTION_PACKS_ALONE)
STICTION_SHARED_BODIES(extern, SerialTeam)
STICTION_SHARED_BODIES(extern, cuda::EmulatedTeam)
#endif

}  // namespace stiction::inline STICTION_ISA
