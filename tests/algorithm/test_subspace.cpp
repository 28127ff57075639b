#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/oracles/hand_answers.hpp"
#include "tests/support/systems/small_systems.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

constexpr SolverKind kSolver = SolverKind::subspace;

TEST(Subspace, SmallSystemsHaveTheAnswersWorkedOutByHand) {
  expect_hand_answers(kSolver, 1e-11, 2000);
}

/// Contacts in a row, pressed together with little tangential load, each strongly coupled to the next. All stick, and
/// A is so ill-conditioned (some n^2) that sweeps are slow.
Environment<double> sticking(std::size_t contacts) {
  const std::size_t n = 3 * contacts;
  std::vector<double> A(n * n, 0.0), b(n, 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    A[i * n + i] = 2;
    if (i >= 3) A[i * n + i - 3] = A[(i - 3) * n + i] = -1;
  }
  for (std::size_t c = 0; c < contacts; ++c) {
    b[3 * c] = -1;
    b[3 * c + 1] = 0.1;
    b[3 * c + 2] = -0.05;
  }
  Environment<double> env = system(std::vector<Cone>(contacts, friction(3)), A, b);
  env.mu.assign(n, 0.8);
  for (std::size_t c = 0; c < contacts; ++c) env.mu[3 * c] = 0;
  return env;
}

/// If everything sticks nothing moves: w = 0 on all rows, whatever the law.
TEST(Subspace, WhatSticksIsSolvedByTheFirstLeap) {
  for (const Law law : kBothLaws) {
    SolverOptions leaps = options(kSolver, 1e-10, 4), sweeps = options(SolverKind::npgs, 1e-10, 4);
    const auto batch = batch_of({sticking(8)}, law);
    const Solution<double> solution = solve(batch, leaps);
    EXPECT_EQ(solution.status[0].code, EnvCode::solved) << solution.status[0].residual;
    for (const double w : solution.w) EXPECT_NEAR(w, 0, 1e-9);
    EXPECT_EQ(solve(batch, sweeps).status[0].code, EnvCode::max_iterations);
  }
}

/// The stack pushed four times as hard sideways, with a tenth of the friction.
Environment<double> sliding(std::size_t contacts) {
  Environment<double> env = sticking(contacts);
  for (std::size_t c = 0; c < contacts; ++c) {
    env.b[3 * c + 1] = 0.4;
    env.mu[3 * c + 1] = env.mu[3 * c + 2] = 0.08;
  }
  return env;
}

TEST(Subspace, WhatSlidesIsLeaptUnderTheConvexLawAndSweptUnderCoulombs) {
  const auto convex = batch_of({sliding(6)}, Law::convex), coulomb = batch_of({sliding(6)}, Law::coulomb);
  const SolverOptions leaps = options(kSolver, 1e-9, 4000), sweeps = options(SolverKind::npgs, 1e-9, 4000);
  const Solution<double> leapt = solve(convex, leaps), swept = solve(convex, sweeps);
  ASSERT_EQ(leapt.status[0].code, EnvCode::solved);
  ASSERT_EQ(swept.status[0].code, EnvCode::solved);
  EXPECT_LT(leapt.status[0].iterations, swept.status[0].iterations);
  for (std::size_t i = 0; i < leapt.lambda.size(); ++i) EXPECT_NEAR(leapt.lambda[i], swept.lambda[i], 1e-6) << i;
  EXPECT_EQ(solve(coulomb, leaps).lambda, solve(coulomb, sweeps).lambda);
}

TEST(Subspace, MoreThanFortyRowsAreSweptAsByNpgs) {
  const auto small = batch_of({sticking(13)}), large = batch_of({sticking(14)});
  const SolverOptions leaps = options(kSolver, 1e-8, 40), sweeps = options(SolverKind::npgs, 1e-8, 40);
  EXPECT_NE(solve(small, leaps).lambda, solve(small, sweeps).lambda);
  EXPECT_EQ(solve(large, leaps).lambda, solve(large, sweeps).lambda);
}

/// Two equal contacts share a load: A is singular, and a pivot is zero.
TEST(Subspace, ASingularMatrixIsNoObstacle) {
  const std::vector<double> A = {1, 1, 1, 1};
  const auto batch = batch_of({system({unilateral(), unilateral()}, A, {-1, -1})});
  const Solution<double> solution = solve(batch, options(kSolver, 1e-12, 100));
  ASSERT_EQ(solution.status[0].code, EnvCode::solved);
  EXPECT_NEAR(solution.lambda[0] + solution.lambda[1], 1, 1e-12);
}

}  // namespace
