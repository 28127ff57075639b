#include "distributed/newton/part_factor.hpp"

#include <algorithm>

#include "core/base/extents.hpp"
#include "core/plan/ordering.hpp"

namespace stiction::distributed {

PartFactor::PartFactor(const BlockPattern& whole, std::span<const Index> rows, Ordering ordering) {
  std::vector<Index> offsets{0}, columns, blocks;
  for (const Index row : rows) {
    for (Index k = whole.offsets[row]; k < whole.offsets[row + 1]; ++k) {
      const auto place = std::lower_bound(rows.begin(), rows.end(), whole.columns[k]);
      if (place == rows.end() || *place != whole.columns[k]) continue;
      columns.push_back(static_cast<Index>(place - rows.begin()));
      blocks.push_back(k);
    }
    offsets.push_back(static_cast<Index>(columns.size()));
  }
  const auto count = static_cast<Index>(rows.size());
  const BlockPattern pattern{count, count, offsets.data(), columns.data()};
  append_block_factor(stream_, pattern, order_rows(pattern, ordering), Fill::complete);
  // The plan is the part's, and the blocks that it begins with are the whole's: nothing is copied.
  const BlockFactorView made = plan();
  const auto first = made.sources - stream_.data();
  for (Index k = 0; k < made.lower.blocks(); ++k) {
    Index& source = stream_[at(first + k)];
    if (source >= 0) source = blocks[at(source)];
  }
  values_.resize(at(Offset{kBodyBlock * kBodyBlock} * made.lower.blocks()));
}

BlockFactorView PartFactor::plan() const {
  const Index* next = stream_.data();
  return take_block_factor(next);
}

void PartFactor::prepare(const BlockPattern& whole, double* blocks) {
  kernels_.factor(plan(), whole, blocks, values_.data());
}

void PartFactor::solve(const double* r, double* z) const {
  kernels_.solve(plan(), values_.data(), r, z);
}

}  // namespace stiction::distributed
