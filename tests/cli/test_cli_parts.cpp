// The parts of the command line that have answers one can work out.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "cli/bits.hpp"
#include "cli/cone_graph.hpp"
#include "cli/convergence.hpp"
#include "cli/permute.hpp"
#include "cli/quantiles.hpp"
#include "tests/cli/batches.hpp"

namespace stiction::cli {
namespace {

TEST(Quantiles, AreNearestRank) {
  std::vector<int> values(10);
  std::iota(values.rbegin(), values.rend(), 1);
  const auto q = quantiles(values);
  ASSERT_TRUE(q);
  EXPECT_EQ(q->min, 1);
  EXPECT_EQ(q->median, 5);
  EXPECT_EQ(q->p90, 9);
  EXPECT_EQ(q->max, 10);
  EXPECT_EQ(quantiles(std::vector<int>{7})->p90, 7);
  EXPECT_EQ(quantiles(std::vector<int>{7, 8})->median, 7);
  EXPECT_FALSE(quantiles(std::vector<int>{}));
}

TEST(Quantiles, ANaNIsLargerThanInfinity) {
  const auto q = quantiles(std::vector<double>{std::nan(""), std::numeric_limits<double>::infinity(), 1.0});
  EXPECT_EQ(q->min, 1);
  EXPECT_TRUE(std::isinf(q->median));
  EXPECT_TRUE(std::isnan(q->max));
}

TEST(Permute, ARandomOrderIsAPermutationAndTheSameOneEveryTime) {
  const auto order = random_order(1000, 3);
  auto sorted = order;
  std::sort(sorted.begin(), sorted.end());
  for (Offset i = 0; i < 1000; ++i) ASSERT_EQ(sorted[static_cast<std::size_t>(i)], i);
  EXPECT_NE(order, sorted);
  EXPECT_EQ(order, random_order(1000, 3));
  EXPECT_NE(order, random_order(1000, 4));
  EXPECT_TRUE(random_order(0, 1).empty());
}

TEST(Permute, ScatterUndoesGather) {
  const std::vector<Offset> offsets{0, 2, 2, 5, 6};
  const std::vector<Offset> order{2, 0, 3, 1};
  const std::vector<int> rows{1, 2, 3, 4, 5, 6};
  const auto gathered = gather_rows(std::span<const int>(rows), std::span<const Offset>(offsets), order);
  EXPECT_EQ(gathered, (std::vector<int>{3, 4, 5, 1, 2, 6}));
  EXPECT_EQ(scatter_rows(std::span<const int>(gathered), std::span<const Offset>(offsets), order), rows);
}

TEST(Bits, UlpsCrossZero) {
  EXPECT_EQ(ulps_text(0.0, -0.0, Precision::f64), "1 ulp");
  EXPECT_EQ(ulps_text(5e-324, -5e-324, Precision::f64), "3 ulps");
  EXPECT_TRUE(same_bits(std::nan("1"), -std::nan("2")));
  EXPECT_FALSE(same_bits(0.0, -0.0));
}

TEST(Convergence, PointsAreTwoAnOctaveAndTheLimit) {
  EXPECT_EQ(convergence_iterations(1), (std::vector<Index>{1}));
  EXPECT_EQ(convergence_iterations(13), (std::vector<Index>{1, 2, 3, 4, 6, 8, 12, 13}));
  EXPECT_TRUE(convergence_iterations(0).empty());
  EXPECT_EQ(convergence_iterations(std::numeric_limits<Index>::max()).back(), std::numeric_limits<Index>::max());
}

/// n unilateral rows with the second-difference matrix.
ContactBatch<double> laplacian(Index n) {
  Environment<double> environment;
  environment.cones.assign(static_cast<std::size_t>(n), {ConeKind::unilateral, 1, -1});
  for (Index i = 0; i < n; ++i) {
    for (const Index j : {i - 1, i, i + 1}) {
      if (j < 0 || j >= n) continue;
      environment.column.push_back(j);
      environment.A.push_back(i == j ? 2 : -1);
    }
    environment.row_offsets.push_back(static_cast<Index>(environment.column.size()));
  }
  environment.b.assign(static_cast<std::size_t>(n), -1);
  ContactBatch<double> batch;
  batch.add(environment);
  return batch;
}

TEST(ConeGraph, JoinsWhatACouplesAndNothingElse) {
  const auto recording = test::chain_recording(3);
  const ConeGraph graph = make_cone_graph(recording.batch.view(), 2);
  EXPECT_EQ(graph.offsets, (std::vector<Index>{0, 1, 3, 4}));
  EXPECT_EQ(graph.neighbours, (std::vector<Index>{1, 0, 2, 1}));
  EXPECT_EQ(graph.island_count, 1);
  EXPECT_EQ(graph.edge_count(), 2U);
}

TEST(ConeGraph, NeighboursInAChainDifferInColourOnBothPaths) {
  for (const Index n : {Index{10}, Index{200}}) {
    const auto batch = laplacian(n);
    const PlanData plan = make_plan(batch.view());
    EXPECT_EQ(plan.path[0], n == 10 ? EnvPath::dense : EnvPath::sparse);
    const ConeGraph graph = make_cone_graph(batch.view(), 0);
    const auto colors = cone_colors(graph, batch.view(), plan, 0);
    EXPECT_LE(*std::max_element(colors.begin(), colors.end()), 2);
    for (std::size_t i = 0; i + 1 < colors.size(); ++i) EXPECT_NE(colors[i], colors[i + 1]) << i;
  }
}

}  // namespace
}  // namespace stiction::cli
