#pragma once

#include "core/job/block_pattern.hpp"

namespace stiction {

/// Blocks that a row of an approximate inverse has at most. A row costs its cube: a body that touches a thousand others
/// must not cost 10^9 blocks' products. Neighbours beyond it are left out, the nearest in number being kept.
inline constexpr Index kInverseRowBlocks = 12;

/// Everything decided in integers before a factored approximate inverse G'G of a symmetric matrix H is computed. Row i
/// of G has the blocks of H's lower triangle in row i, at most kInverseRowBlocks.
struct SparseInverseView {
  BlockPattern lower;                     ///< G by rows, each row's diagonal block last
  const Index* dense_offsets = nullptr;   ///< where each row's own dense system begins, in blocks       (rows + 1)
  const Index* dense_sources = nullptr;   ///< block of H in each place of its lower triangle by rows, -1 for none
                                          ///<                                                    (dense_offsets[rows])
  const Index* column_offsets = nullptr;  ///< where each column's blocks begin                          (rows + 1)
  const Index* column_rows = nullptr;     ///< the row of each, ascending in a column              (lower.blocks())
  const Index* column_blocks = nullptr;   ///< and its number in `lower`                           (lower.blocks())
};

/// Takes it from the stream: the pattern `lower`, then the tables in the order above.
STICTION_HD SparseInverseView take_sparse_inverse(const Index*& stream) {
  SparseInverseView view;
  view.lower = take_pattern(stream);
  const Index rows = view.lower.rows;
  const Index blocks = view.lower.blocks();
  view.dense_offsets = take_table(stream, rows + 1);
  view.dense_sources = take_table(stream, view.dense_offsets[rows]);
  view.column_offsets = take_table(stream, rows + 1);
  view.column_rows = take_table(stream, blocks);
  view.column_blocks = take_table(stream, blocks);
  return view;
}

}  // namespace stiction
