#pragma once

#include "core/job/block_pattern.hpp"

namespace stiction {

/// Everything decided in integers before a symmetric matrix H of blocks is factored as L L'. A "position" is a place in
/// the order of elimination. Positions are sorted by level: those of one level depend on none of each other.
struct BlockFactorView {
  Index rows = 0;
  Index level_count = 0;
  const Index* level_offsets = nullptr;  ///< position where each level begins                  (level_count + 1)
  const Index* order = nullptr;          ///< position -> row of H                               (rows)
  BlockPattern lower;                    ///< L by rows, each row's diagonal block last
  const Index* sources = nullptr;        ///< block of H that each block of L is made from, -1 for fill (lower.blocks())
  const Index* column_offsets = nullptr;  ///< where each column's blocks below the diagonal begin (rows + 1)
  const Index* column_rows = nullptr;    ///< the row of each such block, ascending in a column  (lower.blocks() - rows)
  const Index* column_blocks = nullptr;  ///< and its number in `lower`                          (lower.blocks() - rows)
};

/// Takes a factor's plan from the stream: level_count, level_offsets, the pattern `lower`, order, sources,
/// column_offsets, column_rows, column_blocks.
STICTION_HD BlockFactorView take_block_factor(const Index*& stream) {
  BlockFactorView view;
  view.level_count = stream[0];
  ++stream;
  view.level_offsets = take_table(stream, view.level_count + 1);
  view.lower = take_pattern(stream);
  view.rows = view.lower.rows;
  const Index blocks = view.lower.blocks();
  view.order = take_table(stream, view.rows);
  view.sources = take_table(stream, blocks);
  view.column_offsets = take_table(stream, view.rows + 1);
  view.column_rows = take_table(stream, blocks - view.rows);
  view.column_blocks = take_table(stream, blocks - view.rows);
  return view;
}

}  // namespace stiction
