#include "core/algorithm/load/load_system.hpp"
#include "core/algorithm/solver/pgs.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "scenes/rng.hpp"
#include "tests/support/systems/prepared.hpp"
#include "tests/support/systems/random_systems.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

using DensePgs = Prepared<Pgs, Law::coulomb, Dense>;
using SparsePgs = Prepared<Pgs, Law::coulomb, SparseSystem>;

TEST(Prepare, ScalesAreThePowersOfTwoThatBringDiagonalAndRightHandSideToOne) {
  DensePgs p(system({unilateral(), unilateral()}, {3, 1, 1, 0.25}, {-20, 5}));
  auto& s = p.system();
  EXPECT_EQ(s.scalar[kScaleA], 0.5);
  EXPECT_EQ(s.scalar[kScaleB], 1.0 / 16);
  EXPECT_EQ(s.scalar[kErrorScale], 1.25) << "the largest error without reactions";
  EXPECT_EQ(s.A[0], 1.5);
  EXPECT_EQ(s.A[3], 0.125);
  EXPECT_EQ(s.b[0], -1.25);
  EXPECT_EQ(s.inv_n[1], 8.0);
}

TEST(Prepare, FrictionRowsAreMultipliedByTheirMuOnBothSides) {
  auto env = system({friction(3)}, {1, 0.5, 0.25, 0.5, 1, 0.125, 0.25, 0.125, 1}, {-1, 1, 1});
  env.mu = {7, 0.5, 0.25};  // the normal row's entry is not a friction coefficient
  DensePgs p(env);
  auto& s = p.system();
  EXPECT_EQ(s.block_entry(0, 0, 0), 1.0);
  EXPECT_EQ(s.block_entry(0, 0, 1), 0.5 * 0.5);
  EXPECT_EQ(s.block_entry(0, 1, 1), 0.25);
  EXPECT_EQ(s.block_entry(0, 1, 2), 0.125 * 0.125);
  EXPECT_EQ(s.b[1], 0.5);
  EXPECT_EQ(s.b[2], 0.25);
  EXPECT_EQ(s.residual_weight[0], 1.0) << "what steps count as is the mean diagonal before mu";
  EXPECT_EQ(s.press[0], 1.0);
  EXPECT_EQ(s.axis_press[1], 0.25);
  EXPECT_EQ(s.axis_slip[2], 16.0);
}

TEST(Prepare, DuplicatesAddUpAndComplianceJoinsTheDiagonal) {
  Environment<double> env;
  env.cones = {unilateral()};
  env.row_offsets = {0, 3};
  env.column = {0, 0, 0};
  env.A = {0.5, 0.25, 0.125};
  env.R = {0.25};
  env.b = {-1};
  DensePgs dense(env);
  EXPECT_EQ(dense.system().A[0], 1.125);
  EXPECT_EQ(dense.system().residual_weight[0], 1.125);
  SparsePgs sparse(env);
  EXPECT_EQ(sparse.system().block_entry(0, 0, 0), 1.125);
}

TEST(Prepare, CanonicalOrderSortsConesByKindAndSize) {
  Environment<double> env = system({friction(3), unilateral(), friction(2), free_row()},
                                   diagonal({1, 2, 3, 4, 5, 6, 7}), {1, 2, 3, 4, 5, 6, 7});
  env.mu = {0, 1, 1, 0, 0, 1, 0};
  DensePgs p(env);
  const double expected[] = {7, 4, 5, 6, 1, 2, 3};
  for (Index i = 0; i < 7; ++i) EXPECT_EQ(p.system().b[i], expected[i] / 4) << "row " << i;
}

TEST(Prepare, DenseAndSparseFormsHoldTheSameNumbersOfEveryCone) {
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    Recipe recipe;
    recipe.seed = seed;
    const Environment<double> env = random_contacts(recipe);
    DensePgs dense(env);
    SparsePgs sparse(env);
    auto& d = dense.system();
    auto& s = sparse.system();
    for_each_slot(dense.team, dense.env, d, [&](Index cone, ConeSlot slot) {
      const Index row = dense.env.cone_row(cone);
      EXPECT_EQ(d.residual_weight[slot.cone], s.residual_weight[cone]);
      EXPECT_EQ(d.inv_n[slot.cone], s.inv_n[cone]);
      EXPECT_EQ(d.inv_t[slot.cone], s.inv_t[cone]);
      EXPECT_EQ(d.inv_cone[slot.cone], s.inv_cone[cone]);
      EXPECT_EQ(d.damping[slot.cone], s.damping[cone]);
      EXPECT_EQ(d.share[slot.cone], s.share[cone]);
      EXPECT_EQ(d.lo[slot.cone], s.lo[cone]);
      EXPECT_EQ(d.hi[slot.cone], s.hi[cone]);
      for (Index k = 0; k < dense.env.cone_size(cone); ++k) {
        EXPECT_EQ(d.b[slot.row + k], s.b[row + k]);
        for (Index j = 0; j < dense.env.cone_size(cone); ++j)
          EXPECT_EQ(d.block_entry(slot.row, k, j), s.block_entry(row, k, j));
      }
    });
  }
}

/// The largest eigenvalue of a symmetric block by power iteration.
template <class System>
double largest_eigenvalue(const System& s, Index row, int first, int last) {
  std::vector<double> v(static_cast<std::size_t>(last), 1.0);
  double value = 0;
  for (int iteration = 0; iteration < 20000; ++iteration) {
    std::vector<double> next(v.size(), 0.0);
    double length = 0;
    for (int i = first; i < last; ++i) {
      for (int j = first; j < last; ++j)
        next[static_cast<std::size_t>(i)] += s.block_entry(row, i, j) * v[static_cast<std::size_t>(j)];
      length += next[static_cast<std::size_t>(i)] * next[static_cast<std::size_t>(i)];
    }
    value = std::sqrt(length);
    for (double& entry : next) entry /= value;
    v = next;
  }
  return value;
}

TEST(Prepare, TheEigenvalueBoundIsAboveTheEigenvalueAndAtMostTheSixteenthRootOfTheSizeTooLarge) {
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    const Environment<double> env = random_contacts(lone_contact(seed));
    const Index rows = env.cones[0].row_count;
    DensePgs p(env);
    auto& s = p.system();
    with_shape(ConeKind::friction, rows, [&](auto shape) {
      constexpr int kRows = decltype(shape)::kRows;
      const auto expect_bound = [&](double bound, int first) {
        const double exact = largest_eigenvalue(s, 0, first, kRows);
        if (!(exact > 0)) return;  // every axis frictionless
        EXPECT_GE(bound, exact * (1 - 1e-12)) << "seed " << seed;
        EXPECT_LE(bound, exact * std::pow(static_cast<double>(kRows - first), 1.0 / 16) * (1 + 1e-12));
      };
      if constexpr (kRows > 1) {
        expect_bound(largest_eigenvalue_bound<kRows, 0>(s, 0), 0);
        expect_bound(largest_eigenvalue_bound<kRows, 1>(s, 0), 1);
      }
    });
  }
}

TEST(Prepare, TheMetricOfAConeIsNeverBelowItsBlock) {
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    const Environment<double> env = random_contacts(lone_contact(seed));
    const Index rows = env.cones[0].row_count;
    DensePgs p(env);
    auto& s = p.system();
    // The quadratic form of metric - block in random directions and along the one the coupling pushes hardest.
    scenes::Rng rng(seed);
    for (int sample = 0; sample < 2000; ++sample) {
      std::vector<double> d(static_cast<std::size_t>(rows));
      for (double& entry : d) entry = rng.symmetric(1.0);
      if (sample == 0)
        for (Index k = 1; k < rows; ++k) d[static_cast<std::size_t>(k)] = s.block_entry(0, k, 0);
      double metric = 0;
      double block = 0;
      for (Index i = 0; i < rows; ++i) {
        const double di = d[static_cast<std::size_t>(i)];
        const double step = s.damping[0] * (i == 0 ? s.inv_n[0] : s.inv_t[0]);
        if (step > 0) metric += di * di / step;
        for (Index j = 0; j < rows; ++j) block += di * s.block_entry(0, i, j) * d[static_cast<std::size_t>(j)];
      }
      ASSERT_GE(metric, block * (1 - 1e-12)) << "seed " << seed;
    }
    const double stiffness_n = 1 / s.inv_n[0];
    const double stiffness_t = 1 / s.inv_t[0];
    EXPECT_NEAR(s.share[0], stiffness_t / (stiffness_n + stiffness_t), 1e-14);
    EXPECT_LE(s.damping[0], 1.0);
    EXPECT_GE(s.damping[0], 0.5 * (1 - 1e-12)) << "a symmetric positive block is not coupled more than fully";
  }
}

TEST(Prepare, TheMetricOfACoupledPairIsItsLargestEigenvalue) {
  Environment<double> env = system({friction(2)}, {1, 0.5, 0.5, 1}, {-1, 0});
  env.mu = {0, 1};
  DensePgs p(env);
  EXPECT_NEAR(p.system().damping[0] * p.system().inv_n[0], 1 / 1.5, 1e-15);
  EXPECT_NEAR(p.system().damping[0] * p.system().inv_t[0], 1 / 1.5, 1e-15);
  EXPECT_NEAR(p.system().share[0], 0.5, 1e-15);
}

TEST(Prepare, AWarmStartComesInProjectedOntoItsCones) {
  Environment<double> env = system({unilateral(), box(), friction(3)}, diagonal({1, 1, 1, 1, 1}), {-1, -1, -1, 1, 1});
  env.mu = {0, 0, 0, 0.5, 0.5};
  env.lo = {0, -1, 0, 0, 0};
  env.hi = {0, 1, 0, 0, 0};
  DensePgs p(env, {-3, 4, 1, 8, 0});
  auto& s = p.system();
  EXPECT_EQ(s.x[0], 0.0);
  EXPECT_EQ(s.x[1], 1.0);
  // x = (1, 16, 0) in circular coordinates: onto the cone, half of 1 + 16.
  EXPECT_EQ(s.x[2], 8.5);
  EXPECT_EQ(s.x[3], 8.5);
  EXPECT_EQ(s.x[4], 0.0);
  EXPECT_TRUE(std::isfinite(s.scalar[kBestResidual])) << "the first iterate is recorded";
}

TEST(Prepare, WithoutARightHandSideAWarmStartIsTaken) {
  DensePgs p(system({unilateral()}, {1}, {0}), {5});
  EXPECT_EQ(p.system().x[0], 0.0);
  EXPECT_EQ(p.system().scalar[kErrorScale], 1.0);
}

TEST(Prepare, ABoundThatExcludesZeroCountsAmongTheMotions) {
  Environment<double> env = system({box(), box()}, diagonal({2, 1}), {0, 0});
  env.lo = {3, -7};
  env.hi = {5, 7};
  DensePgs p(env);
  EXPECT_EQ(p.system().scalar[kErrorScale], 6 * p.system().scalar[kScaleB]);
}

TEST(Prepare, BrokenNumbersAreFlaggedAndNothingElseIsDone) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto flags_of = [](const Environment<double>& env) { return DensePgs(env).flags; };
  const auto sound = contact({1, 1, 1}, {-1, 0, 0}, 0.5);
  EXPECT_EQ(flags_of(sound), 0U);
  auto env = sound;
  env.b[1] = nan;
  EXPECT_EQ(flags_of(env), static_cast<std::uint32_t>(kFlagNonFiniteInput));
  env = sound;
  env.mu[2] = -0.1;
  EXPECT_EQ(flags_of(env), static_cast<std::uint32_t>(kFlagNegativeFriction));
  env = sound;
  env.mu[0] = nan;
  EXPECT_EQ(flags_of(env), 0U) << "mu of a normal row is not read";
  env = sound;
  env.R = {0, -1e-3, 0};
  EXPECT_EQ(flags_of(env), static_cast<std::uint32_t>(kFlagNegativeCompliance));
  EXPECT_EQ(flags_of(contact({0, 1, 1}, {-1, 0, 0}, 0.5)), static_cast<std::uint32_t>(kFlagImmovable));
  EXPECT_EQ(flags_of(contact({0, 1, 1}, {1, 0, 0}, 0.5)), 0U) << "nothing asks it to move";
  EXPECT_EQ(flags_of(system({unilateral(), unilateral()}, {0, 1, 1, 1}, {-1, -1})),
            static_cast<std::uint32_t>(kFlagBadDiagonal));
  EXPECT_EQ(flags_of(contact({1, 0, 0}, {-1, 0, 0}, 0.5)), 0U) << "a tangential row may couple to nothing";
  EXPECT_EQ(flags_of(contact({1, -1, 1}, {-1, 0, 0}, 0.5)), static_cast<std::uint32_t>(kFlagBadDiagonal));
  EXPECT_EQ(flags_of(system({free_row()}, {-1}, {1})), 0U) << "a free row bounds nothing";
  env = system({box()}, {1}, {1});
  env.lo = {1};
  env.hi = {-1};
  EXPECT_EQ(flags_of(env), static_cast<std::uint32_t>(kFlagCrossedBounds));
  EXPECT_EQ(DensePgs(sound, {nan, 0, 0}).flags, static_cast<std::uint32_t>(kFlagWarmStartRejected));
  EXPECT_EQ(DensePgs(sound, {0, -1e155, 0}).flags, static_cast<std::uint32_t>(kFlagWarmStartRejected));
  EXPECT_EQ(DensePgs(sound, {0, -1e153, 0}).flags, 0U);
}

TEST(Prepare, AsymmetryIsMeasuredRelativeToTheLargestEntryOnBothForms) {
  const auto env = system({unilateral(), unilateral()}, {2, 1, 1.5, 2}, {-1, -1});
  DensePgs dense(env);
  SparsePgs sparse(env);
  EXPECT_EQ(asymmetry(dense.team, dense.system()), 0.25);
  EXPECT_EQ(asymmetry(sparse.team, sparse.system()), 0.25);
}

}  // namespace
