#pragma once

#include "core/algorithm/velocity/lanes/lane_env.hpp"

namespace stiction::inline STICTION_ISA {

/// Blocks of degrees of freedom that a cone may touch.
inline constexpr Index kMostTouches = 16;
/// Blocks that M may couple all with all.
inline constexpr Index kMostGroupBlocks = 64;
/// Blocks of M + J'GJ for each row, at most. Conjugate gradients multiply its 36 numbers a block, sweeps on A multiply
/// the square of the rows.
inline constexpr Offset kBlocksPerRow = 4;
/// Most rows: counts by an Index stay below its limit.
inline constexpr Index kMostRowsInBlocks = 1 << 21;

/// Returns true if Newton's method in velocities may take an environment in blocks, by its size. Its form is known to
/// be taken (takes_form). Smaller ones go into lanes, and A is small if rows do not outnumber degrees of freedom.
template <class Real>
STICTION_HD bool takes_blocks(const LaneEnv<Real>& env) {
  return env.dofs > kMostVelocityDofs && env.rows <= kMostRowsInBlocks && pays_in_sequence(env.rows, env.dofs);
}

}  // namespace stiction::inline STICTION_ISA
