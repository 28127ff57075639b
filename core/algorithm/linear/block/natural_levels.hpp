#pragma once

#include "core/algorithm/linear/block/block_product.hpp"
#include "core/job/block_factor_view.hpp"

namespace stiction::inline STICTION_ISA {

/// The plan of a factorisation without fill in the natural order of rows. It is made where the matrix is: a device's
/// batch is out of the host's sight. core/plan/block_factor_plan.hpp makes those of other orders, and with fill.
struct NaturalLevels {
  BlockFactorView view;

  /// Integers for a symmetric pattern with every diagonal block.
  static STICTION_HD constexpr Offset integers(Offset rows, Offset blocks) {
    const Offset lower = (blocks + rows) / 2;
    return 6 * (rows + 1) + 4 * lower;
  }

  /// Makes it in memory of that size. Lanes of a team hold equal copies; one of them does the work.
  template <Team TeamT>
  STICTION_HD_OUTLINE void make(TeamT& team, const BlockPattern& H, Index* memory) {
    const Index rows = H.rows, lower = (H.blocks() + rows) / 2;
    const auto take = [&memory](Index size) {
      Index* const part = memory;
      memory += size;
      return part;
    };
    Index* const level_offsets = take(rows + 1);
    Index* const order = take(rows + 1);
    Index* const position = take(rows + 1);
    Index* const offsets = take(rows + 1);
    Index* const column_offsets = take(rows + 1);
    Index* const level = take(rows + 1);  // of each row of H
    Index* const columns = take(lower);
    Index* const sources = take(lower);
    Index* const column_rows = take(lower);
    Index* const column_blocks = take(lower);
    view.rows = rows;
    view.level_count = team.broadcast([&] {
      const Index count = list_levels(H, level, level_offsets);
      for (Index row = 0; row < rows; ++row) {
        position[row] = level_offsets[level[row]]++;
        order[position[row]] = row;
      }
      for (Index l = count; l > 0; --l) level_offsets[l] = level_offsets[l - 1];
      level_offsets[0] = 0;
      list_rows(H, order, position, offsets, columns, sources);
      list_columns(rows, offsets, columns, column_offsets, column_rows, column_blocks);
      return count;
    });
    view.level_offsets = level_offsets;
    view.order = order;
    view.lower = {rows, rows, offsets, columns};
    view.sources = sources;
    view.column_offsets = column_offsets;
    view.column_rows = column_rows;
    view.column_blocks = column_blocks;
  }

 private:
  /// Finds the level of each row and the start of each level. Returns their number.
  static STICTION_HD Index list_levels(const BlockPattern& H, Index* level, Index* offsets) {
    Index count = 0;
    for (Index row = 0; row <= H.rows; ++row) offsets[row] = 0;
    for (Index row = 0; row < H.rows; ++row) {
      level[row] = 0;
      for (Index k = H.offsets[row]; k < H.offsets[row + 1] && H.columns[k] < row; ++k)
        if (level[H.columns[k]] >= level[row]) level[row] = level[H.columns[k]] + 1;
      if (level[row] >= count) count = level[row] + 1;
      ++offsets[level[row] + 1];
    }
    for (Index l = 0; l < count; ++l) offsets[l + 1] += offsets[l];
    return count;
  }

  /// L by rows, columns ascending, and the block of H that each is made from.
  static STICTION_HD void list_rows(const BlockPattern& H, const Index* order, const Index* position, Index* offsets,
                                    Index* columns, Index* sources) {
    Index blocks = 0;
    offsets[0] = 0;
    for (Index at = 0; at < H.rows; ++at) {
      const Index row = order[at], first = blocks;
      for (Index k = H.offsets[row]; k < H.offsets[row + 1] && H.columns[k] <= row; ++k) {
        Index place = blocks++;
        for (; place > first && columns[place - 1] > position[H.columns[k]]; --place) {
          columns[place] = columns[place - 1];
          sources[place] = sources[place - 1];
        }
        columns[place] = position[H.columns[k]];
        sources[place] = k;
      }
      offsets[at + 1] = blocks;
    }
  }

  static STICTION_HD void list_columns(Index rows, const Index* offsets, const Index* columns, Index* column_offsets,
                                       Index* column_rows, Index* column_blocks) {
    for (Index i = 0; i <= rows; ++i) column_offsets[i] = 0;
    for (Index row = 0; row < rows; ++row)
      for (Index k = offsets[row]; k + 1 < offsets[row + 1]; ++k) ++column_offsets[columns[k] + 1];
    for (Index i = 0; i < rows; ++i) column_offsets[i + 1] += column_offsets[i];
    // Back to front, so that the ends that remain are the beginnings.
    for (Index row = rows - 1; row >= 0; --row)
      for (Index k = offsets[row + 1] - 2; k >= offsets[row]; --k) {
        const Index place = --column_offsets[columns[k] + 1];
        column_rows[place] = row;
        column_blocks[place] = k;
      }
    for (Index i = 0; i < rows; ++i) column_offsets[i] = column_offsets[i + 1];
    column_offsets[rows] = offsets[rows] - rows;
  }
};

}  // namespace stiction::inline STICTION_ISA
