#include <gtest/gtest.h>

#include <limits>
#include <numeric>

#include "core/algorithm/driver/solver_selection.hpp"
#include "core/job/fallback_chain.hpp"
#include "tests/support/scene_batches.hpp"
#include "tests/support/small_systems.hpp"

/// SolverKind::automatic: a choice for each environment alone, the same on every machine, and an answer at least as
/// good as the first solver's.
namespace stiction::test {
namespace {

SolverOptions automatic(double tolerance, Index max_iterations) {
  return options(SolverKind::automatic, tolerance, max_iterations);
}

/// Ragged environments, one with a NaN among them, and one without rows.
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
  // So few iterations leave most environments to every stage.
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
  // So few sweeps do not solve these; the stages above have as many iterations each.
  const ContactBatch<double> batch = scene_batch("stack", 6, 3);
  const SolverOptions few = automatic(1e-8, 12);
  const Solution<double> answer = solve(batch, few), sweeps = solve(batch, options(SolverKind::npgs, 1e-8, 12));
  for (std::size_t env = 0; env < answer.status.size(); ++env) {
    EXPECT_NE(sweeps.status[env].code, EnvCode::solved);
    EXPECT_LT(answer.status[env].residual, sweeps.status[env].residual);
  }
}

TEST(FallbackChain, LeadsFromSweepsToWhatIsCertain) {
  EnvFeatures seen;
  seen.rows = 30;
  seen.friction_cones = 10;
  seen.law = Law::coulomb;
  EXPECT_EQ(next_stage(0, seen), kSplittingStage);
  EXPECT_EQ(next_stage(kSplittingStage, seen), kNewtonStage);
  seen.law = Law::convex;
  EXPECT_EQ(next_stage(0, seen), kSplittingStage);
  EXPECT_EQ(next_stage(kSplittingStage, seen), kInteriorStage);
  seen.is_compliant = true;
  EXPECT_EQ(next_stage(0, seen), kNewtonStage);
  EXPECT_EQ(next_stage(kNewtonStage, seen), kInteriorStage);
  seen.is_compliant = false;
  seen.friction_cones = 0;
  EXPECT_EQ(next_stage(0, seen), kInteriorStage);
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
