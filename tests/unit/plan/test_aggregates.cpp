#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <vector>

#include "core/plan/aggregates.hpp"
#include "core/plan/multigrid_plan.hpp"
#include "tests/support/systems/stacked_boxes.hpp"

namespace stiction::test {
namespace {

using Edges = std::vector<std::array<Index, 2>>;
using Numbers = std::vector<Index>;

Numbers aggregate_of(Index bodies, const Edges& edges) {
  return find_aggregates(pattern_of(bodies, edges).view()).aggregate;
}

Edges chain(Index bodies) {
  Edges edges;
  for (Index i = 1; i < bodies; ++i) edges.push_back({i - 1, i});
  return edges;
}

Edges grid(Index side) {
  Edges edges;
  for (Index i = 0; i < side; ++i)
    for (Index j = 0; j < side; ++j) {
      if (j + 1 < side) edges.push_back({side * i + j, side * i + j + 1});
      if (i + 1 < side) edges.push_back({side * i + j, side * i + j + side});
    }
  return edges;
}

TEST(Aggregates, AChainIsCutIntoThreesAndItsEndJoinsTheLast) {
  EXPECT_EQ(aggregate_of(7, chain(7)), (Numbers{0, 0, 1, 1, 1, 2, 2}));
  EXPECT_EQ(aggregate_of(6, chain(6)), (Numbers{0, 0, 1, 1, 1, 1}));
  EXPECT_EQ(find_aggregates(pattern_of(7, chain(7)).view()).root, (Numbers{0, 3, 6}));
}

TEST(Aggregates, AGridIsCoveredByCrossesAndWhatIsLeftJoinsWhereItHasMostNeighbours) {
  EXPECT_EQ(aggregate_of(9, grid(3)), (Numbers{0, 0, 1, 0, 1, 1, 0, 1, 1}));
}

TEST(Aggregates, AStarIsOneAggregateWhereverItsCentreIsNumbered) {
  EXPECT_EQ(aggregate_of(4, {{0, 1}, {0, 2}, {0, 3}}), (Numbers{0, 0, 0, 0}));
  EXPECT_EQ(aggregate_of(4, {{3, 0}, {3, 1}, {3, 2}}), (Numbers{0, 0, 0, 0}));
}

TEST(Aggregates, AmongEqualsTheLowerNumberIsJoined) {
  // 0 - 2 - 4 - 3 - 1, the roots at both ends.
  EXPECT_EQ(aggregate_of(5, {{0, 2}, {2, 4}, {4, 3}, {3, 1}}), (Numbers{0, 1, 0, 1, 0}));
}

TEST(Aggregates, BodiesWithoutNeighboursBelongToNone) {
  EXPECT_EQ(aggregate_of(6, {{1, 2}, {4, 5}}), (Numbers{-1, 0, 0, -1, 1, 1}));
  EXPECT_EQ(aggregate_of(1, {}), (Numbers{-1}));
  EXPECT_EQ(aggregate_of(0, {}), (Numbers{}));
}

TEST(Aggregates, EveryCoupledBodyIsInOneWithANeighbourOfItsOwnAndNearTheRoot) {
  const StackedBoxes scene = StackedBoxes::wall(17);
  const BlockSet set = scene.matrix(1.0).pattern;
  const BlockPattern graph = set.view();
  const Aggregates found = find_aggregates(graph);
  const auto aggregate = [&](Index body) { return found.aggregate[static_cast<std::size_t>(body)]; };
  const auto row = [&](Index body) {
    return std::set<Index>(graph.columns + graph.offsets[body], graph.columns + graph.offsets[body + 1]);
  };
  for (Index body = 0; body < graph.rows; ++body) {
    ASSERT_GE(aggregate(body), 0) << body;
    const std::set<Index> mine = row(body);
    EXPECT_GE(std::count_if(mine.begin(), mine.end(), [&](Index n) { return aggregate(n) == aggregate(body); }), 2);
    const std::set<Index> roots = row(found.root[static_cast<std::size_t>(aggregate(body))]);
    EXPECT_TRUE(std::any_of(mine.begin(), mine.end(), [&](Index n) { return roots.count(n) > 0; })) << body;
  }
}

/// A pattern as a set of (row, column).
std::set<std::array<Index, 2>> entries(const BlockPattern& pattern) {
  std::set<std::array<Index, 2>> found;
  for (Index row = 0; row < pattern.rows; ++row)
    for (Index k = pattern.offsets[row]; k < pattern.offsets[row + 1]; ++k) found.insert({row, pattern.columns[k]});
  return found;
}

std::set<std::array<Index, 2>> product_of(const BlockPattern& left, const BlockPattern& right) {
  std::set<std::array<Index, 2>> found;
  for (const auto& [i, k] : entries(left))
    for (const auto& [l, j] : entries(right))
      if (k == l) found.insert({i, j});
  return found;
}

bool is_ascending(const BlockPattern& pattern) {
  for (Index row = 0; row < pattern.rows; ++row)
    for (Index k = pattern.offsets[row] + 1; k < pattern.offsets[row + 1]; ++k)
      if (pattern.columns[k - 1] >= pattern.columns[k]) return false;
  return true;
}

TEST(MultigridPlan, PatternsAreTheProductsTheyStandFor) {
  for (const Prolongation prolongation : {Prolongation::plain, Prolongation::smoothed}) {
    const BlockSet finest = StackedBoxes::wall(14).matrix(1.0).pattern;
    Numbers stream{7, 7};  // whatever came before
    append_multigrid(stream, finest.view(), prolongation);
    const auto length = stream.size();
    stream.push_back(-5);
    const Index* next = stream.data() + 2;
    const MultigridView view = take_multigrid(next);
    EXPECT_EQ(next, stream.data() + length);
    ASSERT_GE(view.levels(), 2);
    EXPECT_EQ(view.finest_rows(), finest.rows());
    Index rows = 0, blocks = 0, weights = 0;
    BlockPattern matrix = finest.view();
    for (Index l = 0; l < view.levels(); ++l) {
      const MultigridLevel level = view.level(l);
      EXPECT_EQ(level.rows, matrix.rows);
      EXPECT_EQ(level.first_row, rows);
      EXPECT_EQ(level.first_block, blocks);
      EXPECT_EQ(level.first_weight, weights);
      rows += level.rows;
      if (l > 0) blocks += matrix.blocks();
      if (l + 1 == view.levels()) break;
      const BlockPattern coarse = view.level(l + 1).matrix;
      EXPECT_LE(2 * coarse.rows, level.rows);
      std::set<std::array<Index, 2>> rigid;
      for (Index body = 0; body < level.rows; ++body) rigid.insert({body, level.aggregate[body]});
      if (prolongation == Prolongation::plain) {
        EXPECT_EQ(entries(level.prolongation), rigid);
      }
      for (const auto& entry : rigid) EXPECT_EQ(entries(level.prolongation).count(entry), 1U);
      EXPECT_EQ(entries(level.product), product_of(matrix, level.prolongation));
      EXPECT_EQ(entries(coarse), product_of(level.restriction, level.product));
      EXPECT_TRUE(is_ascending(level.prolongation) && is_ascending(level.restriction) && is_ascending(level.product) &&
                  is_ascending(coarse));
      for (Index row = 0; row < level.restriction.rows; ++row)
        for (Index k = level.restriction.offsets[row]; k < level.restriction.offsets[row + 1]; ++k) {
          const Index original = level.transposed[k], body = level.restriction.columns[k];
          EXPECT_EQ(level.prolongation.columns[original], row);
          EXPECT_TRUE(level.prolongation.offsets[body] <= original && original < level.prolongation.offsets[body + 1]);
        }
      weights += level.prolongation.blocks();
      matrix = coarse;
    }
    EXPECT_EQ(view.all_rows(), rows);
    EXPECT_EQ(view.coarse_blocks(), blocks);
    EXPECT_EQ(view.weights(), weights);
  }
}

TEST(MultigridPlan, CoarsensDownToWhatADenseFactorTakesAndNotAtAllBelow) {
  const auto plan = [](Index bodies, const Edges& edges, auto&& look) {
    Numbers stream;
    append_multigrid(stream, pattern_of(bodies, edges).view(), Prolongation::plain);
    look(MultigridView{stream.data()});
  };
  for (const Index bodies : {0, 1, 60})
    plan(bodies, chain(bodies), [&](const MultigridView& view) {
      EXPECT_EQ(view.levels(), 1) << bodies;
      EXPECT_EQ(view.dense_bodies(), bodies == 1 ? 0 : bodies);
    });
  plan(2000, chain(2000), [](const MultigridView& view) {
    EXPECT_EQ(view.levels(), 5);  // thirds: 2000, 667, 223, 75, 25
    EXPECT_EQ(view.dense_bodies(), 25);
  });
  // A thousand pairs are a thousand single bodies one level down, where nothing is left to do.
  Edges pairs;
  for (Index i = 0; i < 1000; ++i) pairs.push_back({2 * i, 2 * i + 1});
  plan(2001, pairs, [](const MultigridView& view) {
    EXPECT_EQ(view.levels(), 2);
    EXPECT_EQ(view.dense_bodies(), 0);
    EXPECT_EQ(view.level(1).rows, 1000);
    EXPECT_EQ(view.level(0).aggregate[2000], -1);
  });
}

}  // namespace
}  // namespace stiction::test
