#pragma once

#include "stiction/types.hpp"

/// The size of complementary pivoting (docs/math/lemke.md). It has a pair of variables for each row, and another one
/// for each axis of boxed friction.
namespace stiction {

inline constexpr Index kPairVectors = 15;   ///< doubles of a pair, beside the matrix of pairs x pairs
inline constexpr Index kPivotVectors = 96;  ///< doubles that an environment has for each row, beside rows x rows

/// Returns true if the pairs of an environment find room in that: 13 contacts of three rows do, and any number of
/// single rows. `axes` counts the rows of its cones but the first.
STICTION_HD constexpr bool pairs_fit(Index rows, Index axes) {
  const Offset pairs = Offset{rows} + axes;
  return pairs * (kPairVectors + pairs) <= Offset{rows} * (kPivotVectors + rows);
}
static_assert(pairs_fit(39, 26) && !pairs_fit(42, 28));

}  // namespace stiction
