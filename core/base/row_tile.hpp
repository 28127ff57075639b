#pragma once

#include "core/base/real.hpp"
#include "core/base/transpose.hpp"
#include "stiction/types.hpp"

namespace stiction::inline STICTION_ISA {

/// As many rows of one environment as a lane of a team works on at once, in kVectors vectors side by side. Their
/// chains of operations do not wait for each other. Wide is a Pack, or a Real on its own: one row. Each row has the
/// bits it would have alone, so a tile reaches speed alone.
template <class WideReal, Index kVectorCount = 1>
struct RowTile {
  using Wide = WideReal;
  using Real = Scalar<WideReal>;
  static constexpr Index kVectors = kVectorCount;
  static constexpr Index kLanes = RealTraits<WideReal>::kLanes;
  static constexpr Index kRows = kLanes * kVectors;
  static constexpr bool kOneRow = kRows == 1;
};

/// Rows of numbers into a tile: entry k of row(r) to x[k step + r], k < columns. Behind the last of the `count` rows it
/// is repeated, so that every lane has numbers.
template <class Tile, class Row>
STICTION_HD void turn_rows(Index count, Index columns, const Row& row, typename Tile::Real* x, Index step) {
  using Real = typename Tile::Real;
  constexpr Index kLanes = Tile::kLanes;
  for (Index group = 0; group < Tile::kRows; group += kLanes) {
    const Real* from[kLanes];
    for (Index r = 0; r < kLanes; ++r) from[r] = row(group + r < count ? group + r : count - 1);
    Index k = 0;
    if constexpr (!Tile::kOneRow && kTileEdge<Real> == kLanes) {
      for (; k + kLanes <= columns; k += kLanes) {
        Real turned[kLanes][kLanes];
        transpose_tile(from, turned);
        for (Index r = 0; r < kLanes; ++r) from[r] += kLanes;
        for (Index c = 0; c < kLanes; ++c) {
          typename Tile::Wide entries;
          load_lanes(turned[c], entries);
          store_lanes(x + static_cast<Offset>(k + c) * step + group, entries);
        }
      }
    }
    for (Index rest = k; rest < columns; ++rest)
      for (Index r = 0; r < kLanes; ++r) x[static_cast<Offset>(rest) * step + group + r] = from[r][rest - k];
  }
}

}  // namespace stiction::inline STICTION_ISA
