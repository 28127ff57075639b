#include <gtest/gtest.h>

#include "stiction/error.hpp"
#include "tests/support/oracles/hand_answers.hpp"
#include "tests/support/systems/small_systems.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

constexpr SolverKind kSolver = SolverKind::pgs;

TEST(Pgs, SmallSystemsHaveTheAnswersWorkedOutByHand) {
  expect_hand_answers(kSolver, 1e-11, 2000);
}

/// lambda after so many iterations.
std::vector<double> iterate(const Environment<double>& env, Law law, Index iterations, double omega = 1) {
  SolverOptions o = options(kSolver, 0, iterations);
  o.omega = omega;
  return solve(batch_of({env}, law), o).lambda;
}

TEST(Pgs, ASweepUsesTheFreshReactionsOfTheRowsBefore) {
  // 2 lambda_0 = 2 first; then 2 lambda_1 = 2 - lambda_0.
  const auto env = system({unilateral(), unilateral()}, {2, 1, 1, 2}, {-2, -2});
  EXPECT_EQ(iterate(env, Law::convex, 1), (std::vector<double>{1, 0.5}));
  // lambda_0 = (2 - 0.5) / 2, lambda_1 = (2 - 0.75) / 2.
  EXPECT_EQ(iterate(env, Law::convex, 2), (std::vector<double>{0.75, 0.625}));
}

TEST(Pgs, RelaxationScalesTheStepOfARow) {
  const auto env = system({unilateral(), unilateral()}, {2, 1, 1, 2}, {-2, -2});
  // lambda_0 = 1.5 * 1, lambda_1 = 1.5 * (2 - 1.5) / 2.
  EXPECT_EQ(iterate(env, Law::convex, 1, 1.5), (std::vector<double>{1.5, 0.375}));
  EXPECT_EQ(iterate(env, Law::convex, 1, 0.5), (std::vector<double>{0.5, 0.375}));
}

TEST(Pgs, OneContactUnderCoulombsLawIsSolvedInOneVisit) {
  // The normal first, then friction on the disk of the fresh normal; the tangential block is a multiple of identity.
  const auto lambda = iterate(contact({1, 1, 1}, {-2, 3, 0}, 0.5), Law::coulomb, 1);
  EXPECT_NEAR(lambda[0], 2, 1e-15);
  EXPECT_NEAR(lambda[1], -1, 1e-2) << "the eigenvalue bound of the block is at most 2^(1/16) too large";
  EXPECT_LE(std::abs(lambda[1]), 1.0);
}

TEST(Pgs, RowsOfOtherKindsAreVisitedInCanonicalOrder) {
  // File order: unilateral, free. Canonical order visits the free row first: lambda_1 = 1, then lambda_0 = (2 - 1) / 2.
  const auto env = system({unilateral(), free_row()}, {2, 1, 1, 2}, {-2, -2});
  EXPECT_EQ(iterate(env, Law::convex, 1), (std::vector<double>{0.5, 1}));
}

TEST(Pgs, AnUnsymmetricSystemIsSolvedWhereTheSweepContracts) {
  // 2 x - y = 1, 2 y = 2: x = 1, y = 1.
  const auto env = system({unilateral(), unilateral()}, {2, -1, 0, 2}, {-1, -2});
  const Solution<double> solution = solve(batch_of({env}), options(kSolver, 1e-12, 10));
  EXPECT_EQ(solution.status[0].code, EnvCode::solved);
  EXPECT_NEAR(solution.lambda[0], 1, 1e-12);
}

}  // namespace
