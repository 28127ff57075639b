#pragma once

#include "core/algorithm/pack/gather_rows.hpp"

/// Rows and columns of matrices in memory, as they are dealt out to lanes.
namespace stiction::inline STICTION_ISA {

/// Cuts a lane's columns into tiles and returns their number. A lane with padding goes on reading the next rows,
/// up to the next cut.
template <class Real, class Workspace>
Index cut_columns(const Workspace& workspace, const PendingLoad<Real>* loads, int count) {
  ColumnTile* const tiles = workspace.tile;
  Index found = 0;
  for (Index c = 0; c < workspace.n; ++c) {
    bool is_cut = c == 0 || tiles[found - 1].count == kTileEdge<Real>;
    for (int e = 0; e < count && !is_cut; ++e) {
      const Index* const batch_row = workspace.rows_of(loads[e].lane);
      const bool goes_on = batch_row[c - 1] >= 0 && batch_row[c] == batch_row[c - 1] + 1;
      is_cut = !loads[e].is_written && batch_row[c] >= 0 && !goes_on;
    }
    if (is_cut) tiles[found++] = {c, 0};
    ++tiles[found - 1].count;
  }
  return found;
}

/// Finds an entrant's rows. The last rows of a matrix that is read where it is stored are copied, so that a tile may
/// reach beyond its end.
template <class Real, class Workspace>
void find_rows(const Workspace& workspace, const PendingLoad<Real>& load) {
  constexpr Index kLine = Workspace::kLine, W = Workspace::kLanes;
  const Index* const batch_row = workspace.rows_of(load.lane);
  const Index rows = load.env->n;
  const Index some = (kLine - 1 + rows - 1) / rows;
  const Index first = some < rows ? rows - some : 0;
  Real* const tail = workspace.tail + Offset{workspace.tail_length} * load.lane;
  if (!load.is_written)
    for (Index k = 0; k < (rows - first) * rows; ++k) tail[k] = load.matrix[Offset{rows} * first + k];
  for (Index r = 0; r < workspace.n; ++r) {
    const Index i = batch_row[r];
    workspace.row[r * W + load.lane] = i < 0             ? workspace.zeros
                                       : load.is_written ? load.matrix + Offset{workspace.n} * r
                                       : i < first       ? load.matrix + Offset{rows} * i
                                                         : tail + Offset{rows} * (i - first);
  }
}

}  // namespace stiction::inline STICTION_ISA
