#include "core/plan/block_sets.hpp"

#include <algorithm>
#include <numeric>

#include "core/base/extents.hpp"

namespace stiction {
BlockSet multiply_patterns(const BlockPattern& left, const BlockPattern& right) {
  BlockSet product;
  product.columns_total = right.columns_total;
  product.offsets.reserve(at(left.rows) + 1);
  std::vector<Index> last_row(at(right.columns_total), -1);
  for (Index row = 0; row < left.rows; ++row) {
    const auto begin = static_cast<std::ptrdiff_t>(product.columns.size());
    for (Index k = left.offsets[row]; k < left.offsets[row + 1]; ++k)
      for (Index l = right.offsets[left.columns[k]]; l < right.offsets[left.columns[k] + 1]; ++l) {
        const Index column = right.columns[l];
        if (last_row[at(column)] == row) continue;
        last_row[at(column)] = row;
        product.columns.push_back(column);
      }
    std::sort(product.columns.begin() + begin, product.columns.end());
    product.offsets.push_back(static_cast<Index>(product.columns.size()));
  }
  return product;
}

TransposedSet transpose_pattern(const BlockPattern& pattern) {
  TransposedSet transposed;
  BlockSet& set = transposed.set;
  set.columns_total = pattern.rows;
  set.offsets.assign(at(pattern.columns_total) + 1, 0);
  set.columns.resize(at(pattern.blocks()));
  transposed.block.resize(set.columns.size());
  for (Index k = 0; k < pattern.blocks(); ++k) ++set.offsets[at(pattern.columns[k]) + 1];
  std::partial_sum(set.offsets.begin(), set.offsets.end(), set.offsets.begin());
  std::vector<Index> next(set.offsets.begin(), set.offsets.end() - 1);
  for (Index row = 0; row < pattern.rows; ++row)
    for (Index k = pattern.offsets[row]; k < pattern.offsets[row + 1]; ++k) {
      const auto place = at(next[at(pattern.columns[k])]++);
      set.columns[place] = row;
      transposed.block[place] = k;
    }
  return transposed;
}

}  // namespace stiction
