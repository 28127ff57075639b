#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "core/plan/block_tables.hpp"
#include "stiction/error.hpp"
#include "tests/support/machines/preconditioner_room.hpp"
#include "tests/support/machines/stress_team.hpp"

#ifdef STICTION_TEST_HAS_EIGEN
#include <Eigen/Sparse>
#endif

namespace stiction::test {
namespace {

std::vector<BoxScene> scenes() {
  BoxScene nothing;
  nothing.centres.push_back({});
  BoxScene apart = random_touching(1, 9, 0.0);
  BoxScene islands = box_tower(5);
  for (Index b = 0; b < 6; ++b) {
    islands.centres.push_back({5.0, 0.0, 0.5 + b});
    islands.rest(b > 0 ? 4 + b : -1, 5 + b);
  }
  return {nothing,
          apart,
          islands,
          box_tower(30),
          box_wall(7, 8),
          box_pyramid(5),
          random_touching(2, 15, 1.0),
          random_touching(3, 60, 0.06)};
}

std::vector<Ordering> orderings() {
  std::vector<Ordering> there;
  for (int i = 0; i < kOrderingCount; ++i)
    if (is_available(static_cast<Ordering>(i))) there.push_back(static_cast<Ordering>(i));
  return there;
}

std::vector<Index> level_of(const BlockFactorView& plan) {
  std::vector<Index> level(static_cast<std::size_t>(plan.rows), -1);
  for (Index l = 0; l < plan.level_count; ++l)
    for (Index k = plan.level_offsets[l]; k < plan.level_offsets[l + 1]; ++k) level[static_cast<std::size_t>(k)] = l;
  return level;
}

/// (L L')_ij for every place of the factor, less H_ij: the largest over those in `counts`.
template <class F>
double largest_difference_from(PreconditionerWorkspace& workspace, F&& counts) {
  const BlockFactorView plan = workspace.factor();
  const BlockMatrix L{plan.lower, workspace.memory.data()};
  const auto n = static_cast<std::size_t>(workspace.n());
  std::vector<double> dense(n * n, 0.0);
  for (Index row = 0; row < plan.rows; ++row)
    for (Index k = plan.lower.offsets[row]; k < plan.lower.offsets[row + 1]; ++k)
      for (Index i = 0; i < 6; ++i)
        for (Index j = 0; j < 6; ++j)
          if (plan.lower.columns[k] < row || j <= i)
            dense[static_cast<std::size_t>(row * 6 + i) * n + static_cast<std::size_t>(plan.lower.columns[k] * 6 + j)] =
                L.block(k)[i * 6 + j];
  const std::vector<double> H = dense_of(workspace.system.matrix());
  double worst = 0.0;
  for (Index p = 0; p < plan.rows; ++p)
    for (Index q = 0; q <= p; ++q) {
      if (!counts(plan, p, q)) continue;
      for (Index i = 0; i < 6; ++i)
        for (Index j = 0; j < 6; ++j) {
          double sum = 0.0;
          for (std::size_t k = 0; k < n; ++k)
            sum +=
                dense[static_cast<std::size_t>(p * 6 + i) * n + k] * dense[static_cast<std::size_t>(q * 6 + j) * n + k];
          worst = std::max(worst, std::abs(sum - H[static_cast<std::size_t>(plan.order[p] * 6 + i) * n +
                                                   static_cast<std::size_t>(plan.order[q] * 6 + j)]));
        }
    }
  return worst;
}

TEST(BlockFactor, ThePlanIsWhatItSays) {
  for (const BoxScene& scene : scenes())
    for (const Ordering ordering : orderings())
      for (const Fill fill : {Fill::complete, Fill::none}) {
        SCOPED_TRACE(to_string(ordering));
        const BlockSystem system = box_matrix(scene, 1e-3);
        const BlockPattern H = system.pattern();
        std::vector<Index> stream{-5};
        append_block_factor(stream, H, order_rows(H, ordering), fill);
        const Index* next = stream.data() + 1;
        const BlockFactorView plan = take_block_factor(next);
        ASSERT_EQ(next, stream.data() + stream.size()) << "all of it is read";
        ASSERT_EQ(plan.rows, H.rows);
        ASSERT_EQ(plan.level_offsets[plan.level_count], H.rows);
        std::vector<Index> order(plan.order, plan.order + plan.rows);
        std::sort(order.begin(), order.end());
        for (Index row = 0; row < plan.rows; ++row) ASSERT_EQ(order[static_cast<std::size_t>(row)], row);

        const std::vector<Index> level = level_of(plan);
        std::set<Index> sources;
        std::set<std::pair<Index, Index>> blocks;
        for (Index row = 0; row < plan.rows; ++row) {
          ASSERT_EQ(plan.lower.columns[plan.lower.offsets[row + 1] - 1], row) << "the diagonal is last";
          for (Index k = plan.lower.offsets[row]; k < plan.lower.offsets[row + 1]; ++k) {
            const Index column = plan.lower.columns[k];
            ASSERT_TRUE(blocks.emplace(row, column).second);
            if (column != row) {
              ASSERT_LT(level[static_cast<std::size_t>(column)], level[static_cast<std::size_t>(row)]);
            }
            ASSERT_EQ(plan.sources[k], find_block(H, plan.order[row], plan.order[column]));
            if (plan.sources[k] >= 0) sources.insert(plan.sources[k]);
          }
        }
        EXPECT_EQ(static_cast<Index>(sources.size()), (H.blocks() + H.rows) / 2) << "every block of H's lower triangle";
        if (fill == Fill::none) {
          EXPECT_EQ(plan.lower.blocks(), (H.blocks() + H.rows) / 2);
        }
        for (Index column = 0; column < plan.rows; ++column)
          for (Index k = plan.column_offsets[column]; k < plan.column_offsets[column + 1]; ++k) {
            ASSERT_EQ(plan.lower.columns[plan.column_blocks[k]], column);
            const Index row = plan.column_rows[k];
            ASSERT_GE(plan.column_blocks[k], plan.lower.offsets[row]);
            ASSERT_LT(plan.column_blocks[k], plan.lower.offsets[row + 1] - 1);
            blocks.erase({row, column});
          }
        EXPECT_EQ(static_cast<Index>(blocks.size()), plan.rows) << "the columns have all but the diagonal";
      }
}

TEST(BlockFactor, AGridHasFewerLevelsThanRowsAndFreeBodiesHaveOne) {
  const auto levels = [](const BoxScene& scene, Ordering ordering) {
    PreconditionerWorkspace workspace(box_matrix(scene, 1e-3), Preconditioning::block_ldl, ordering);
    return workspace.factor().level_count;
  };
  EXPECT_EQ(levels(random_touching(1, 9, 0.0), Ordering::natural), 1);
  EXPECT_EQ(levels(box_tower(30), Ordering::natural), 30);
  if (is_available(Ordering::minimum_degree)) {
    EXPECT_LT(levels(box_pyramid(8), Ordering::minimum_degree), box_pyramid(8).bodies() / 2);
  }
  if (is_available(Ordering::nested_dissection)) {
    EXPECT_LE(levels(box_tower(30), Ordering::nested_dissection), 10) << "a chain is halved again and again";
  }
}

TEST(BlockFactor, ItsProductIsTheMatrix) {
  for (const BoxScene& scene : scenes())
    for (const Ordering ordering : orderings()) {
      PreconditionerWorkspace workspace(box_matrix(scene, 1e-3, 20), Preconditioning::block_ldl, ordering);
      workspace.apply(random_vector(workspace.n(), 1));
      // Entries of H reach some 1e5; the roundings of sums of at most 360 products of them are below that by 1e-13.
      EXPECT_LT(largest_difference_from(workspace, [](auto&&...) { return true; }), 1e-8) << to_string(ordering);
    }
}

TEST(BlockFactor, ConjugateGradientsNeedItOnceOrTwice) {
  for (const double compliance : {1e-3, 1e-6})
    for (const BoxScene& scene : scenes()) {
      PreconditionerWorkspace workspace(box_matrix(scene, compliance, 20), Preconditioning::block_ldl);
      std::vector<double> x;
      const std::vector<double> b = random_vector(workspace.n(), 2);
      const GradientOutcome outcome = workspace.solve(b, x, 1e-10, 5);
      EXPECT_TRUE(outcome.is_met);
      EXPECT_LE(outcome.iterations, 2);
    }
}

TEST(BlockFactor, LanesChangeNoBit) {
  for (const BoxScene& scene : scenes()) {
    PreconditionerWorkspace workspace(box_matrix(scene, 1e-3, 20), Preconditioning::block_ldl);
    const std::vector<double> r = random_vector(workspace.n(), 4);
    const std::vector<double> z = workspace.apply(r), factor = workspace.memory;
    for (const Index lanes : {1, 3, 32}) {
      std::fill(workspace.memory.begin(), workspace.memory.end(), -77.0);
      std::vector<double> there(r.size());
      run_stressed(
          lanes,
          [&](auto& team) { workspace.use(team, [&](const auto& ldl) { ldl.apply(team, r.data(), there.data()); }); },
          9);
      EXPECT_EQ(workspace.memory, factor) << lanes;
      EXPECT_EQ(there, z) << lanes;
    }
  }
}

TEST(BlockFactor, WhatIsNoPermutationIsRefused) {
  const BlockSystem system = box_matrix(box_tower(3), 1e-3);
  std::vector<Index> stream;
  for (const std::vector<Index>& order : {std::vector<Index>{0, 1}, {0, 1, 1}, {0, 1, 3}, {-1, 0, 1}})
    EXPECT_THROW(append_block_factor(stream, system.pattern(), order, Fill::complete), Error);
  EXPECT_TRUE(stream.empty());
}

#ifdef STICTION_TEST_HAS_EIGEN

using Sparse = Eigen::SparseMatrix<double>;

/// One number for each block of H with its rows in order; positive definite.
Sparse pattern_in_order(const BlockPattern& H, const std::vector<Index>& order) {
  std::vector<Index> position(order.size());
  for (std::size_t k = 0; k < order.size(); ++k) position[static_cast<std::size_t>(order[k])] = static_cast<Index>(k);
  std::vector<Eigen::Triplet<double>> entries;
  for (Index row = 0; row < H.rows; ++row)
    for (Index k = H.offsets[row]; k < H.offsets[row + 1]; ++k)
      entries.emplace_back(position[static_cast<std::size_t>(row)], position[static_cast<std::size_t>(H.columns[k])],
                           H.columns[k] == row ? H.rows : -0.5);
  Sparse matrix(H.rows, H.rows);
  matrix.setFromTriplets(entries.begin(), entries.end());
  return matrix;
}

TEST(BlockFactor, FillIsWhatEigenCountsInTheSameOrder) {
  for (const BoxScene& scene : scenes())
    for (const Ordering ordering : orderings()) {
      const BlockSystem system = box_matrix(scene, 1e-3);
      const std::vector<Index> order = order_rows(system.pattern(), ordering);
      std::vector<Index> stream;
      append_block_factor(stream, system.pattern(), order, Fill::complete);
      const Index* next = stream.data();
      const Eigen::SimplicialLLT<Sparse, Eigen::Lower, Eigen::NaturalOrdering<int>> llt(
          pattern_in_order(system.pattern(), order));
      ASSERT_EQ(llt.info(), Eigen::Success);
      EXPECT_EQ(take_block_factor(next).lower.blocks(), Sparse(llt.matrixL()).nonZeros()) << to_string(ordering);
    }
}

TEST(BlockFactor, MinimumDegreeFillsAsMuchAsEigensOwnFactorisation) {
  if (!is_available(Ordering::minimum_degree)) GTEST_SKIP() << "built without Eigen";
  for (const BoxScene& scene : {box_wall(12, 12), box_pyramid(8)}) {
    const BlockSystem system = box_matrix(scene, 1e-3);
    PreconditionerWorkspace workspace(system, Preconditioning::block_ldl, Ordering::minimum_degree);
    const Eigen::SimplicialLLT<Sparse, Eigen::Lower, Eigen::AMDOrdering<int>> llt(
        pattern_in_order(system.pattern(), order_rows(system.pattern(), Ordering::natural)));
    EXPECT_EQ(workspace.factor().lower.blocks(), Sparse(llt.matrixL()).nonZeros());
  }
}

TEST(BlockFactor, ItsSolutionIsEigens) {
  for (const BoxScene& scene : scenes())
    for (const Ordering ordering : orderings()) {
      PreconditionerWorkspace workspace(box_matrix(scene, 1e-3, 20), Preconditioning::block_ldl, ordering);
      const std::vector<double> r = random_vector(workspace.n(), 6), z = workspace.apply(r);
      const std::vector<double> H = dense_of(workspace.system.matrix());
      using Dense = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
      const Sparse sparse = Eigen::Map<const Dense>(H.data(), workspace.n(), workspace.n()).sparseView();
      const Eigen::SimplicialLLT<Sparse> llt(sparse);
      ASSERT_EQ(llt.info(), Eigen::Success);
      const Eigen::VectorXd expected = llt.solve(Eigen::Map<const Eigen::VectorXd>(r.data(), workspace.n()));
      const double difference =
          (Eigen::Map<const Eigen::VectorXd>(z.data(), workspace.n()) - expected).lpNorm<Eigen::Infinity>();
      // The smallest eigenvalue is that of the masses, about 0.1, the largest some 1e6: 1e7 roundings of either.
      EXPECT_LT(difference, 1e-8 * expected.lpNorm<Eigen::Infinity>()) << to_string(ordering);
    }
}

#endif

}  // namespace
}  // namespace stiction::test
