#include <gtest/gtest.h>

#include <vector>

#include "core/runtime/check/defects.hpp"
#include "stiction/batch.hpp"

namespace {

using namespace stiction;

/// Unilateral rows with those columns.
Environment<double> rows_of(const std::vector<std::vector<Index>>& columns) {
  Environment<double> env;
  env.cones.assign(columns.size(), {ConeKind::unilateral, 1, -1});
  for (const auto& row : columns) {
    for (const Index column : row) {
      env.column.push_back(column);
      env.A.push_back(1.0);
    }
    env.row_offsets.push_back(static_cast<Index>(env.column.size()));
  }
  env.b.assign(columns.size(), -1.0);
  env.R.assign(columns.size(), 1.0);  // no row is without a diagonal
  return env;
}

ContactBatch<double> batch_of(const std::vector<Environment<double>>& envs) {
  ContactBatch<double> batch;
  for (const auto& env : envs) batch.add(env);
  return batch;
}

std::vector<FullRows> seen_by_both(const ContactBatchView<double>& view) {
  std::vector<FullRows> structure;
  std::vector<FullRows> values;
  EXPECT_TRUE(validate_structure(view, 64, all_at_once, &structure).empty());
  EXPECT_TRUE(validate(view, 64, SolverKind::npgs, all_at_once, values).empty());
  EXPECT_EQ(structure, values);
  return structure;
}

constexpr FullRows kKnown = FullRows::known;
constexpr FullRows kUnknown = FullRows::unknown;

TEST(FullRows, AreKnownWhereEveryRowHoldsEveryColumnInOrder) {
  const ContactBatch<double> batch = batch_of({rows_of({{0}}),                                // one row
                                               rows_of({{0, 1, 2}, {0, 1, 2}, {0, 1, 2}}),    // all
                                               rows_of({}),                                   // none
                                               rows_of({{0, 1, 2}, {0, 1, 2}, {0, 2, 1}}),    // not in order
                                               rows_of({{1, 0}, {1, 0}}),                     // alike, not in order
                                               rows_of({{0, 1, 2}, {0, 1}, {0, 1, 2}}),       // one is missing
                                               rows_of({{0, 1, 2}, {0, 1, 1}, {0, 1, 2}}),    // and one there twice
                                               rows_of({{0, 1}, {0}}),                        // a run, not full
                                               rows_of({{0, 1, 2}, {0, 1}, {0, 1, 2, 2}})});  // as many in all
  EXPECT_EQ(seen_by_both(batch.view()), (std::vector<FullRows>{kKnown, kKnown, kUnknown, kUnknown, kUnknown, kUnknown,
                                                               kUnknown, kUnknown, kUnknown}));
}

TEST(FullRows, MayShareTheirColumns) {
  const ContactBatch<double> batch = batch_of({rows_of({{0, 1}, {0, 1}}), rows_of({{0, 1}, {0, 1}})});
  const std::vector<Index> columns{0, 1, 0};
  const std::vector<Offset> shared{0, 0, 0, 1};  // the last row: columns 1, 0
  ContactBatchView<double> view = batch.view();
  view.column = columns.data();
  view.column_count = 3;
  view.column_offsets = shared.data();
  EXPECT_EQ(seen_by_both(view), (std::vector<FullRows>{kKnown, kUnknown}));
}

TEST(FullRows, AreNotKnownWithRoomBetweenThem) {
  const ContactBatch<double> batch = batch_of({rows_of({{0, 1, 0}, {0, 1, 0}}), rows_of({{0, 1}, {0, 1}})});
  const std::vector<Index> counts{2, 2, 2, 2};
  ContactBatchView<double> view = batch.view();
  view.row_counts = counts.data();
  EXPECT_EQ(seen_by_both(view), (std::vector<FullRows>{kUnknown, kKnown}));
}

}  // namespace
