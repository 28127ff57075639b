#include "core/schedule/multigrid_plan.hpp"

#include <algorithm>

#include "core/schedule/aggregates.hpp"
#include "core/schedule/block_sets.hpp"

namespace stiction {
namespace {

bool is_coupled(const BlockPattern& pattern, Index row) {
  return pattern.offsets[row + 1] - pattern.offsets[row] > 1;
}

/// Each coupled body in its aggregate's column.
BlockSet tentative_pattern(const Aggregates& aggregates) {
  BlockSet set;
  set.columns_total = static_cast<Index>(aggregates.root.size());
  for (const Index aggregate : aggregates.aggregate) {
    if (aggregate >= 0) set.columns.push_back(aggregate);
    set.offsets.push_back(static_cast<Index>(set.columns.size()));
  }
  return set;
}

/// Of each body its place among the coupled, -1 if it is not; returns their number.
Index list_places(const BlockPattern& pattern, std::vector<Index>& place) {
  Index count = 0;
  for (Index row = 0; row < pattern.rows; ++row) place.push_back(is_coupled(pattern, row) ? count++ : -1);
  return count;
}

void append(const std::vector<Index>& table, std::vector<Index>& stream) {
  stream.insert(stream.end(), table.begin(), table.end());
}

/// The sums over levels that the stream's head holds.
struct Totals {
  Index rows = 0, coarse_blocks = 0, weights = 0, largest_product = 0;
};

}  // namespace

void append_multigrid(const BlockPattern& finest, Prolongation prolongation, std::vector<Index>& stream) {
  const bool is_smoothed = prolongation == Prolongation::smoothed;
  Totals totals;
  std::vector<Index> begins, body;  // of the levels in `body`, which follows them in the stream
  BlockSet kept;
  BlockPattern matrix = finest;
  Index dense_bodies = 0;
  for (bool is_coarsest = false; !is_coarsest;) {
    const bool is_finest = begins.empty();
    begins.push_back(static_cast<Index>(body.size()));
    append({matrix.rows, totals.rows, totals.coarse_blocks, totals.weights}, body);
    totals.rows += matrix.rows;
    if (!is_finest) {
      append_pattern(matrix, body);
      totals.coarse_blocks += matrix.blocks();
    }
    std::vector<Index> place;
    dense_bodies = list_places(matrix, place);
    is_coarsest = dense_bodies <= kCoarsestBodies;
    if (is_coarsest) {
      append(place, body);
      break;
    }
    const Aggregates aggregates = find_aggregates(matrix);
    BlockSet weights = tentative_pattern(aggregates);
    if (is_smoothed) weights = multiply_patterns(matrix, weights.view());
    const TransposedSet restriction = transpose_pattern(weights.view());
    const BlockSet product = multiply_patterns(matrix, weights.view());
    append_pattern(weights.view(), body);
    append(aggregates.aggregate, body);
    append(aggregates.root, body);
    append_pattern(restriction.set.view(), body);
    append(restriction.block, body);
    append_pattern(product.view(), body);
    totals.weights += weights.view().blocks();
    totals.largest_product = std::max(totals.largest_product, product.view().blocks());
    kept = multiply_patterns(restriction.set.view(), product.view());
    matrix = kept.view();
  }
  const auto levels = static_cast<Index>(begins.size());
  const Index head = MultigridView::kHeader + levels;
  append({head + static_cast<Index>(body.size()), levels, is_smoothed ? 1 : 0, finest.rows, totals.rows,
          totals.coarse_blocks, totals.weights, totals.largest_product, dense_bodies},
         stream);
  for (const Index begin : begins) stream.push_back(head + begin);
  append(body, stream);
}

}  // namespace stiction
