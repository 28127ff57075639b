#pragma once

#include "core/algorithm/driver/shared_instances.hpp"
#include "cuda/emulated/emulated_team.hpp"
#if !defined(STICTION_PACKS_ALONE) && !defined(STICTION_TEST_NO_BASELINE)
#include "cpu_fallback/tables/shared_instances.hpp"
#endif

/// The library's instances of loading, recording and judging, on one lane and on the emulated device's teams. Builds of
/// packs alone have neither, and a build for one machine has no baseline.
namespace stiction::inline STICTION_ISA {

#if !defined(STICTION_PACKS_ALONE)
STICTION_SHARED_BODIES(extern, cuda::EmulatedTeam)
#endif

}  // namespace stiction::inline STICTION_ISA
