#include "core/schedule/sparse_inverse_plan.hpp"

#include "core/schedule/block_tables.hpp"

namespace stiction {

void append_sparse_inverse(std::vector<Index>& stream, const BlockPattern& pattern) {
  expect_diagonal(pattern);
  std::vector<Index> offsets{0};
  std::vector<Index> columns;
  std::vector<Index> dense_offsets{0};
  std::vector<Index> dense_sources;
  for (Index row = 0; row < pattern.rows; ++row) {
    const Index diagonal = find_block(pattern, row, row);
    const Index first = std::max(pattern.offsets[row], diagonal - (kInverseRowBlocks - 1));
    for (Index i = first; i <= diagonal; ++i) {
      columns.push_back(pattern.columns[i]);
      for (Index j = first; j <= i; ++j)
        dense_sources.push_back(find_block(pattern, pattern.columns[i], pattern.columns[j]));
    }
    offsets.push_back(static_cast<Index>(columns.size()));
    dense_offsets.push_back(static_cast<Index>(dense_sources.size()));
  }
  append_pattern(stream, pattern.rows, pattern.rows, offsets, columns);
  stream.insert(stream.end(), dense_offsets.begin(), dense_offsets.end());
  stream.insert(stream.end(), dense_sources.begin(), dense_sources.end());
  append_columns(stream, offsets, columns, true);
}

}  // namespace stiction
