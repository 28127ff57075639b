#include <gtest/gtest.h>

#include "stiction/error.hpp"
#include "tests/support/oracles/hand_answers.hpp"
#include "tests/support/systems/small_systems.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

constexpr SolverKind kSolver = SolverKind::jacobi;

TEST(Jacobi, SmallSystemsHaveTheAnswersWorkedOutByHand) {
  expect_hand_answers(kSolver, 1e-10, 20000);
}

TEST(Jacobi, AllConesStepAtOnceFromTheOldReactions) {
  // By symmetry both rows take the same step; a Gauss-Seidel sweep would not.
  const auto env = system({unilateral(), unilateral()}, {2, 1, 1, 2}, {-2, -2});
  const auto lambda = solve(batch_of({env}), options(kSolver, 0, 1)).lambda;
  EXPECT_EQ(lambda[0], lambda[1]);
  // The safe step is 1 / 3, the inverse of the largest eigenvalue of this matrix.
  EXPECT_NEAR(lambda[0], 2.0 / 3, 1e-12);
}

TEST(Jacobi, TheStepIsSafeWherePlainJacobiDiverges) {
  // Ten contacts on one body: A all ones, for which steps of 1 / A_ii overshoot tenfold.
  constexpr std::size_t kContacts = 10;
  const auto env = system(std::vector<Cone>(kContacts, unilateral()), std::vector<double>(kContacts * kContacts, 1.0),
                          std::vector<double>(kContacts, -1.0));
  const Solution<double> solution = solve(batch_of({env}), options(kSolver, 1e-9, 100));
  EXPECT_EQ(solution.status[0].code, EnvCode::solved);
  double sum = 0;
  for (const double lambda : solution.lambda) sum += lambda;
  EXPECT_NEAR(sum, 1, 1e-8);
}

TEST(Jacobi, UnitsOfDifferentBodiesDoNotSlowEachOtherDown) {
  // Two islands whose masses differ by 1e6: each gets a separate step.
  const auto env = system({unilateral(), unilateral()}, diagonal({1, 1e-6}), {-1, -1});
  const Solution<double> solution = solve(batch_of({env}), options(kSolver, 1e-12, 50));
  EXPECT_EQ(solution.status[0].code, EnvCode::solved) << solution.status[0].residual;
  EXPECT_NEAR(solution.lambda[1], 1e6, 1e-3);
}

}  // namespace
