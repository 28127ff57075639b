#include "core/plan/multigrid_plan.hpp"

#include <array>

#include "core/base/extents.hpp"
#include "core/plan/aggregates.hpp"
#include "core/plan/block_sets.hpp"
#include "core/plan/block_tables.hpp"

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

/// Lists each body's index among the coupled, -1 if it is not; returns their number.
Index list_places(const BlockPattern& pattern, std::vector<Index>& place) {
  Index count = 0;
  for (Index row = 0; row < pattern.rows; ++row) place.push_back(is_coupled(pattern, row) ? count++ : -1);
  return count;
}

/// The sums over levels that the stream's head holds.
struct Totals {
  Index rows = 0, coarse_blocks = 0, weights = 0, largest_product = 0;
};

}  // namespace

void append_multigrid(std::vector<Index>& stream, const BlockPattern& finest, Prolongation prolongation) {
  const bool is_smoothed = prolongation == Prolongation::smoothed;
  Totals totals;
  std::vector<Index> begins, body;  // of the levels in `body`, which follows them in the stream
  BlockSet kept;
  BlockPattern matrix = finest;
  Index dense_bodies = 0;
  for (bool is_coarsest = false; !is_coarsest;) {
    const bool is_finest = begins.empty();
    begins.push_back(static_cast<Index>(body.size()));
    append_table(body, std::array{matrix.rows, totals.rows, totals.coarse_blocks, totals.weights});
    totals.rows += matrix.rows;
    if (!is_finest) {
      append_pattern(body, matrix);
      totals.coarse_blocks += matrix.blocks();
    }
    std::vector<Index> place;
    dense_bodies = list_places(matrix, place);
    is_coarsest = dense_bodies <= kCoarsestBodies;
    if (is_coarsest) {
      append_table(body, place);
      break;
    }
    const Aggregates aggregates = find_aggregates(matrix);
    BlockSet weights = tentative_pattern(aggregates);
    if (is_smoothed) weights = multiply_patterns(matrix, weights.view());
    const TransposedSet restriction = transpose_pattern(weights.view());
    const BlockSet product = multiply_patterns(matrix, weights.view());
    append_pattern(body, weights.view());
    append_table(body, aggregates.aggregate);
    append_table(body, aggregates.root);
    append_pattern(body, restriction.set.view());
    append_table(body, restriction.block);
    append_pattern(body, product.view());
    totals.weights += weights.view().blocks();
    totals.largest_product = larger_of(totals.largest_product, product.view().blocks());
    kept = multiply_patterns(restriction.set.view(), product.view());
    matrix = kept.view();
  }
  const auto levels = static_cast<Index>(begins.size());
  const Index head = MultigridView::kHeader + levels;
  append_table(
      stream, std::array{head + static_cast<Index>(body.size()), levels, is_smoothed ? Index{1} : Index{0}, finest.rows,
                         totals.rows, totals.coarse_blocks, totals.weights, totals.largest_product, dense_bodies});
  for (const Index begin : begins) stream.push_back(head + begin);
  append_table(stream, body);
}

}  // namespace stiction
