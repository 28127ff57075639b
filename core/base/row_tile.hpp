#pragma once

#include "core/base/real.hpp"
#include "stiction/types.hpp"

namespace stiction::inline STICTION_ISA {

/// As many rows of one environment as a lane of a team works on at once, in kVectors vectors side by side: their chains
/// of operations do not wait for each other. Wide is a Pack, or a Real on its own: one row. Each row has the bits
/// it would have by itself, so a tile reaches speed alone.
template <class WideReal, Index kVectorCount = 1>
struct RowTile {
  using Wide = WideReal;
  using Real = Scalar<WideReal>;
  static constexpr Index kVectors = kVectorCount;
  static constexpr Index kLanes = RealTraits<WideReal>::kLanes;
  static constexpr Index kRows = kLanes * kVectors;
  static constexpr bool kOneRow = kRows == 1;
};

}  // namespace stiction::inline STICTION_ISA
