#include "core/plan/sparse_inverse_plan.hpp"

#include "core/base/extents.hpp"
#include "core/plan/block_tables.hpp"

namespace stiction {

void append_sparse_inverse(std::vector<Index>& stream, const BlockPattern& pattern) {
  expect_diagonal(pattern);
  std::vector<Index> offsets{0};
  std::vector<Index> columns;
  std::vector<Index> dense_offsets{0};
  std::vector<Index> dense_sources;
  for (Index row = 0; row < pattern.rows; ++row) {
    const Index diagonal = find_block(pattern, row, row);
    const Index first = larger_of(pattern.offsets[row], diagonal - (kInverseRowBlocks - 1));
    for (Index i = first; i <= diagonal; ++i) {
      columns.push_back(pattern.columns[i]);
      for (Index j = first; j <= i; ++j)
        dense_sources.push_back(find_block(pattern, pattern.columns[i], pattern.columns[j]));
    }
    offsets.push_back(static_cast<Index>(columns.size()));
    dense_offsets.push_back(static_cast<Index>(dense_sources.size()));
  }
  append_pattern(stream, pattern.rows, offsets, columns);
  append_table(stream, dense_offsets);
  append_table(stream, dense_sources);
  append_columns(stream, offsets, columns, true);
}

}  // namespace stiction
