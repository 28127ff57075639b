#include <gtest/gtest.h>

#include "stiction/error.hpp"
#include "tests/support/oracles/hand_answers.hpp"
#include "tests/support/systems/small_systems.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

constexpr SolverKind kSolver = SolverKind::npgs;

TEST(Npgs, SmallSystemsHaveTheAnswersWorkedOutByHand) {
  expect_hand_answers(kSolver, 1e-11, 2000);
}

/// A column of unit masses: the tridiagonal matrix on which plain sweeps need some n^2 iterations.
Environment<double> column(std::size_t n) {
  std::vector<double> A(n * n, 0.0), b(n, 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    A[i * n + i] = i == 0 ? 1 : 2;
    if (i > 0) A[i * n + i - 1] = A[(i - 1) * n + i] = -1;
  }
  b[0] = -1;
  return system(std::vector<Cone>(n, unilateral()), A, b);
}

TEST(Npgs, TheFirstIterationHasNoMomentumAndIsAPlainSweep) {
  const auto batch = batch_of({column(12)});
  EXPECT_EQ(solve(batch, options(kSolver, 0, 1)).lambda, solve(batch, options(SolverKind::pgs, 0, 1)).lambda);
  EXPECT_NE(solve(batch, options(kSolver, 0, 3)).lambda, solve(batch, options(SolverKind::pgs, 0, 3)).lambda);
}

TEST(Npgs, MomentumPaysOnAColumnOfMasses) {
  const auto batch = batch_of({column(40)});
  const Solution<double> with = solve(batch, options(kSolver, 1e-8, 20000));
  const Solution<double> without = solve(batch, options(SolverKind::pgs, 1e-8, 20000));
  ASSERT_EQ(with.status[0].code, EnvCode::solved);
  ASSERT_EQ(without.status[0].code, EnvCode::solved);
  EXPECT_LT(5 * with.status[0].iterations, without.status[0].iterations)
      << with.status[0].iterations << " and " << without.status[0].iterations;
}

TEST(Npgs, AColumnCarriesTheWeightAboveEachContact) {
  const Solution<double> solution = solve(batch_of({column(20)}), options(kSolver, 1e-10, 20000));
  for (std::size_t i = 0; i < 20; ++i) EXPECT_NEAR(solution.lambda[i], 20.0 - static_cast<double>(i), 1e-6);
}

}  // namespace
