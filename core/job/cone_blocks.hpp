#pragma once

#include "stiction/types.hpp"

namespace stiction {

/// Most rows of cones that a sweep solves together: a face against a face has four contacts of three.
inline constexpr Index kMostBlockRows = 12;
/// Visits of the cones of a block before a sweep goes on (docs/math/pgs.md, "Blocks of cones").
inline constexpr Index kBlockVisits = 2;

/// A cone's place among those of its environment, and whether it begins a block, as one number. A batch that is solved
/// in blocks has it in cone_group.
STICTION_HD constexpr Index block_place(Index place, bool begins) {
  return 2 * place + (begins ? 1 : 0);
}
STICTION_HD constexpr Index place_of(Index block_place) {
  return block_place / 2;
}
STICTION_HD constexpr bool begins_block(Index block_place) {
  return block_place % 2 != 0;
}

}  // namespace stiction
