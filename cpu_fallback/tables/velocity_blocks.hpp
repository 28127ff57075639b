#pragma once

#include "core/base/macros.hpp"
#include "cpu_fallback/tables/velocity_kernels.hpp"

namespace stiction::inline STICTION_ISA {

/// Newton's method in velocities on an environment in blocks, by one lane.
template <class Real>
VelocityResult solve_one_in_blocks(const VelocityJob<Real>& job, const LaneEnv<Real>& env,
                                   cpu::VelocityScratch& scratch);

}  // namespace stiction::inline STICTION_ISA
