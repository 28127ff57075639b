#pragma once

#include "core/algorithm/linear/block/block_product.hpp"
#include "core/algorithm/velocity/blocks/cone_touches.hpp"

namespace stiction::inline STICTION_ISA {

/// Blocks of H = M + J'GJ: where M couples two, and where a cone touches both.
struct HessianPattern {
  BlockPattern pattern;
  bool fits = true;  ///< it has no more blocks than there is room for
  Index* offsets;    ///< (blocks + 1)
  Index* columns;    ///< (kBlocksPerRow rows)
  Index* mark;       ///< the last row that a column was listed in (blocks)

  static STICTION_HD constexpr Offset integers(Offset rows, Offset dofs) {
    return 2 * (DofBlocks::most(dofs) + 1) + kBlocksPerRow * rows;
  }

  STICTION_HD HessianPattern(Index rows, Index dofs, Index*& memory) {
    offsets = memory;
    mark = offsets + DofBlocks::most(dofs) + 1;
    columns = mark + DofBlocks::most(dofs) + 1;
    memory = columns + kBlocksPerRow * rows;
  }

  /// Lanes of a team hold equal copies.
  template <Team TeamT>
  STICTION_HD_OUTLINE void find(TeamT& team, const DofBlocks& dofs, const ConeTouches& touches, Index rows) {
    fits = team.broadcast([&] { return list_rows(dofs, touches, kBlocksPerRow * rows); });
    pattern = {dofs.count, dofs.count, offsets, columns};
    if (fits) for_each(team, dofs.count, [&](Index row) { sort_row(row); });
  }

 private:
  STICTION_HD bool list_rows(const DofBlocks& dofs, const ConeTouches& touches, Offset room) const {
    for (Index row = 0; row < dofs.count; ++row) mark[row] = -1;
    Index blocks = 0;
    offsets[0] = 0;
    for (Index row = 0; row < dofs.count; ++row) {
      const auto add = [&](Index column) {
        if (mark[column] == row) return true;
        mark[column] = row;
        if (blocks == room) return false;
        columns[blocks++] = column;
        return true;
      };
      const Index first = dofs.of_block[row];
      for (Index column = first; column < dofs.count && dofs.of_block[column] == first; ++column)
        if (!add(column)) return false;
      for (Index k = touches.of_begin[row]; k < touches.of_begin[row + 1]; ++k) {
        const Index cone = touches.cone[touches.of_block[k]];
        for (Index t = touches.begin[cone]; t < touches.begin[cone + 1]; ++t)
          if (!add(touches.block[t])) return false;
      }
      offsets[row + 1] = blocks;
    }
    return true;
  }

  /// By Shell's method: a block that touches all others has a long row.
  STICTION_HD void sort_row(Index row) const {
    Index* const list = columns + offsets[row];
    const Index count = offsets[row + 1] - offsets[row];
    Index gap = 1;
    while (gap < count / 3) gap = 3 * gap + 1;
    for (; gap > 0; gap /= 3)
      for (Index i = gap; i < count; ++i) {
        const Index column = list[i];
        Index at = i;
        for (; at >= gap && list[at - gap] > column; at -= gap) list[at] = list[at - gap];
        list[at] = column;
      }
  }
};

}  // namespace stiction::inline STICTION_ISA
