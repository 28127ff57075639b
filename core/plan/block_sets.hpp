#pragma once

#include <vector>

#include "core/job/block_pattern.hpp"

namespace stiction {

/// A pattern of blocks that owns its arrays.
struct BlockSet {
  Index columns_total = 0;
  std::vector<Index> offsets{0};  ///< (rows + 1)
  std::vector<Index> columns;     ///< of each row, ascending

  [[nodiscard]] Index rows() const { return static_cast<Index>(offsets.size()) - 1; }
  [[nodiscard]] BlockPattern view() const { return {rows(), columns_total, offsets.data(), columns.data()}; }
};

/// Returns the blocks of a product: wherever some (i, k) of the left meets a (k, j) of the right.
BlockSet multiply_patterns(const BlockPattern& left, const BlockPattern& right);

/// A transpose, and for each of its blocks the number it has in the original.
struct TransposedSet {
  BlockSet set;
  std::vector<Index> block;
};
TransposedSet transpose_pattern(const BlockPattern& pattern);

}  // namespace stiction
