#include <gtest/gtest.h>

#include <limits>
#include <numeric>

#include "core/algorithm/driver/solver_selection.hpp"
#include "core/job/fallback_order.hpp"
#include "tests/support/systems/scene_batches.hpp"
#include "tests/support/systems/small_systems.hpp"

/// SolverKind::automatic: a choice for each environment alone, the same on every machine, and an answer at least as
/// good as the first solver's.
namespace stiction::test {
namespace {

SolverOptions automatic(double tolerance, Index max_iterations) {
  return options(SolverKind::automatic, tolerance, max_iterations);
}

/// Ragged environments, including one with a NaN and one without rows.
ContactBatch<double> mixed_lot() {
  ContactBatch<double> batch = ragged_batch(2, 9);
  auto arrays = batch.arrays();
  arrays.b[static_cast<std::size_t>(arrays.env_row_offsets[3])] = std::numeric_limits<double>::quiet_NaN();
  batch = ContactBatch<double>::from_arrays(batch.law(), std::move(arrays));
  batch.add(Environment<double>{});
  return batch;
}

TEST(FallbackChain, NamesAnAnswererThatThereIs) {
  SolverOptions chosen = automatic(1e-6, 24);
  chosen.invalid = InvalidPolicy::isolate;
  const Solution<double> answer = solve(mixed_lot(), chosen);
  for (const EnvStatus& status : answer.status) EXPECT_LT(static_cast<int>(status.solver), kSolverKindCount);
}

TEST(FallbackChain, ThreadsNeighboursAndOrderChangeNothing) {
  const ContactBatch<double> batch = mixed_lot();
  SolverOptions chosen = automatic(1e-6, 24);
  chosen.invalid = InvalidPolicy::isolate;
  const auto expected = solve_hashes(batch, chosen);
  chosen.threads = 3;
  EXPECT_EQ(solve_hashes(batch, chosen), expected);
  std::vector<Offset> order(static_cast<std::size_t>(batch.env_count()));
  std::iota(order.rbegin(), order.rend(), Offset{0});
  const auto backwards = solve_hashes(gather(batch, order), chosen);
  for (std::size_t k = 0; k < order.size(); ++k)
    EXPECT_EQ(backwards[k], expected[static_cast<std::size_t>(order[k])]) << order[k];
}

template <class Real>
void expect_device_twin(double tolerance, Index max_iterations, Index most_rows = 100) {
  // Emulated factorisations of the largest would take a minute.
  const ContactBatch<double> all = mixed_lot();
  std::vector<Offset> small;
  for (Offset env = 0; env < all.env_count(); ++env)
    if (all.view().env_rows(env) <= most_rows) small.push_back(env);
  ASSERT_GT(small.size(), most_rows < 100 ? 3U : 12U);
  const ContactBatch<Real> batch = convert<Real>(gather(all, small));
  SolverOptions chosen = automatic(tolerance, max_iterations);
  chosen.invalid = InvalidPolicy::isolate;
  const Solution<Real> here = solve(batch, chosen);
  const Solution<Real> there = solve(batch, chosen, Device::emulated());
  EXPECT_EQ(env_hashes(batch, there), env_hashes(batch, here));
  for (std::size_t env = 0; env < here.status.size(); ++env)
    EXPECT_EQ(there.status[env].solver, here.status[env].solver) << env;
}

TEST(FallbackChain, ADeviceTakesTheStagesOfTheCpu) {
  // These few iterations leave most environments to every stage.
  expect_device_twin<float>(1e-5, 5);
  expect_device_twin<double>(1e-7, 5);
}

/// Later stages have no environments then: nothing is sorted for them, and nothing of the stage before may be left.
TEST(FallbackChain, ADeviceLeavesAloneWhatIsSolved) {
  expect_device_twin<float>(1e-2, 2000, 24);
}

TEST(FallbackChain, WhateverTheFirstSolverSolvesIsSolved) {
  const ContactBatch<double> batch = ragged_batch(1, 2);
  const Index enough = stage_iterations(0, 1, std::numeric_limits<Index>::max());
  const Solution<double> first = solve(batch, options(SolverKind::npgs, 1e-4, enough));
  const Solution<double> answer = solve(batch, automatic(1e-4, enough));
  for (std::size_t env = 0; env < first.status.size(); ++env)
    if (first.status[env].code == EnvCode::solved) {
      EXPECT_EQ(answer.status[env].code, EnvCode::solved) << env;
    }
}

TEST(FallbackChain, GoesOnWhereTheFirstSolverFallsShort) {
  // These few sweeps do not solve these; the stages above have as many iterations each.
  const ContactBatch<double> batch = scene_batch("stack", 6, 3);
  const SolverOptions few = automatic(1e-8, 12);
  const Solution<double> answer = solve(batch, few), sweeps = solve(batch, options(SolverKind::npgs, 1e-8, 12));
  for (std::size_t env = 0; env < answer.status.size(); ++env) {
    EXPECT_NE(sweeps.status[env].code, EnvCode::solved);
    EXPECT_LT(answer.status[env].residual, sweeps.status[env].residual);
  }
}

/// The solvers that such an environment goes through if none solves it.
std::vector<SolverKind> way_of(const EnvFeatures& seen) {
  std::vector<SolverKind> way;
  for (int turn = first_turn(seen), before = -1; turn != before; turn = next_turn(turn, seen)) {
    way.push_back(fallback_turn(turn).solver);
    before = turn;
  }
  return way;
}

TEST(FallbackChain, LeadsFromSweepsToWhatIsCertain) {
  using enum SolverKind;
  using Way = std::vector<SolverKind>;
  EnvFeatures seen;
  seen.rows = 30;
  seen.entries = 900;
  seen.friction_cones = 10;
  seen.law = Law::coulomb;
  EXPECT_EQ(way_of(seen), (Way{subspace, admm, newton, ipm, apgd, npgs, newton}));
  seen.law = Law::convex;
  EXPECT_EQ(way_of(seen), (Way{subspace, admm, ipm, apgd, npgs, newton}));
  seen.is_compliant = true;
  EXPECT_EQ(way_of(seen), (Way{subspace, newton, ipm, apgd, npgs, newton}));
  seen.is_compliant = false;
  seen.friction_cones = 0;
  EXPECT_EQ(way_of(seen), (Way{subspace, ipm, lemke, apgd, npgs, newton}));
  seen.spread = 1e4;
  EXPECT_EQ(way_of(seen), (Way{admm, ipm, lemke, apgd, npgs, newton}));
  seen.is_pivots = true;
  EXPECT_EQ(way_of(seen), Way{lemke});
}

TEST(FallbackChain, BoxedFrictionIsSweptAndThenPivotedWherePairsFit) {
  using enum SolverKind;
  using Way = std::vector<SolverKind>;
  EnvFeatures seen;
  seen.rows = 39;
  seen.axes = 26;
  seen.friction_cones = seen.boxed_cones = 13;
  EXPECT_EQ(way_of(seen), (Way{subspace, lemke, npgs}));
  seen.spread = 1e4;
  EXPECT_EQ(way_of(seen), (Way{subspace, lemke, npgs}));
  seen.boxed_cones = 12;
  EXPECT_EQ(way_of(seen), (Way{subspace, npgs})) << "a friction cone is not half lines";
  seen.boxed_cones = 13;
  seen.is_pivots = true;
  EXPECT_EQ(way_of(seen), Way{subspace}) << "which flags the diagonal";
  seen.is_pivots = false;
  seen.rows = 42;
  seen.axes = 28;
  seen.friction_cones = seen.boxed_cones = 14;
  EXPECT_EQ(way_of(seen), (Way{subspace, npgs})) << "the pairs do not fit";
}

TEST(FallbackChain, OnSparseEnvironmentsGradientsComeBeforeWhatFactorises) {
  using enum SolverKind;
  using Way = std::vector<SolverKind>;
  EnvFeatures seen;
  seen.rows = 600;
  seen.friction_cones = 200;
  seen.law = Law::coulomb;
  // 4096 (146981.25 + 48 * 600) multiplications are ten times 600^3 / 3.
  seen.entries = 146981;
  EXPECT_EQ(way_of(seen), (Way{subspace, apgd, admm, newton, ipm, npgs, newton}));
  seen.entries = 146982;
  EXPECT_EQ(way_of(seen), (Way{subspace, admm, newton, ipm, apgd, npgs, newton}));
  seen.entries = 5000;
  seen.law = Law::convex;
  EXPECT_EQ(way_of(seen), (Way{subspace, apgd, admm, ipm, npgs, newton}));
  seen.spread = 1e4;
  EXPECT_EQ(way_of(seen), (Way{admm, ipm, apgd, npgs, newton}));
  seen.spread = 1;
  seen.is_compliant = true;
  EXPECT_EQ(way_of(seen), (Way{subspace, apgd, newton, ipm, npgs, newton}));
  seen.friction_cones = 0;
  seen.is_compliant = false;
  EXPECT_EQ(way_of(seen), (Way{subspace, apgd, ipm, lemke, npgs, newton}));
  seen.rows = 1025;
  EXPECT_EQ(way_of(seen), (Way{subspace, apgd, npgs}));
  seen.has_matrices = true;
  EXPECT_EQ(way_of(seen), Way{apgd});
  seen.rows = 600;
  EXPECT_EQ(way_of(seen), (Way{admm, apgd}));
  seen.boxed_cones = 200;
  EXPECT_EQ(way_of(seen), Way{jacobi});
}

/// A row of boxes, each of which holds the next: sparse enough for gradients to come before factorisations.
ContactBatch<double> long_row(Index rows) {
  const auto n = static_cast<std::size_t>(rows);
  std::vector<double> A(n * n, 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    A[i * n + i] = 2.125;
    if (i > 0) A[i * n + i - 1] = A[(i - 1) * n + i] = -1;
  }
  ContactBatch<double> batch(Law::coulomb);
  batch.add(system(std::vector<Cone>(n, unilateral()), A, std::vector<double>(n, -1.0)));
  return batch;
}

/// 16 sweeps are too few, 16 gradient steps from there are enough. Every row is pushed, so A lambda = 1.
TEST(FallbackChain, GradientsAnswerBeforeAnInteriorPointIsAsked) {
  constexpr Index kRows = 256;
  constexpr double kTolerance = 1e-3;
  const ContactBatch<double> batch = long_row(kRows);
  const SolverOptions few = automatic(kTolerance, 16);
  EXPECT_NE(solve(batch, options(SolverKind::subspace, kTolerance, 16)).status[0].code, EnvCode::solved);
  for (const Device& device : {Device::cpu(), Device::emulated()}) {
    const Solution<double> answer = solve(batch, few, device);
    EXPECT_EQ(answer.status[0].code, EnvCode::solved);
    EXPECT_EQ(answer.status[0].solver, SolverKind::apgd);
    for (std::size_t i = 0; i < kRows; ++i) {
      const double before = i > 0 ? answer.lambda[i - 1] : 0.0, after = i + 1 < kRows ? answer.lambda[i + 1] : 0.0;
      EXPECT_GT(answer.lambda[i], 0.0) << i;
      EXPECT_NEAR(2.125 * answer.lambda[i] - before - after, 1.0, kTolerance) << i;
    }
  }
}

/// Room that rows leave unused is not multiplied, and a product with A = Y Y' reads Y twice.
TEST(FallbackChain, CountsTheEntriesThatAProductReads) {
  const Offset offsets[] = {7, 17, 27, 37};
  const Index counts[] = {2, 3, 1};
  const double factor[6] = {};
  EnvView<double> env{};
  env.n = 3;
  env.row_offsets = offsets;
  EXPECT_EQ(product_entries(env), 30);
  env.row_counts = counts;
  EXPECT_EQ(product_entries(env), 6);
  env.factor = factor;
  env.dofs = 2;
  EXPECT_EQ(product_entries(env), 12);
}

TEST(FallbackChain, StartsFromAWarmStart) {
  const ContactBatch<double> batch = scene_batch("walker", 6, 3);
  const Solution<double> cold = solve(batch, automatic(1e-8, 2000));
  const Solution<double> warm =
      solve(batch, automatic(1e-6, 2000), Device::cpu(), std::span<const double>(cold.lambda));
  for (const EnvStatus& status : warm.status) EXPECT_EQ(status.iterations, 0);
}

}  // namespace
}  // namespace stiction::test
