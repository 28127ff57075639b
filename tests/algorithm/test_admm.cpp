#include "core/algorithm/solver/admm/admm.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <span>
#include <vector>

#include "tests/support/oracles/hand_answers.hpp"
#include "tests/support/oracles/random_checks.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

constexpr SolverKind kSolver = SolverKind::admm;

TEST(Anderson, TheWeightsAreThoseOfTheLeastSquaresProblem) {
  // f = 2 a - 3 b exactly, in four dimensions.
  const std::vector<std::vector<double>> steps{{1, 0, 2, 1}, {0, 1, 1, -1}};
  const std::vector<double> f{2, -3, 1, 5};
  SerialTeam team;
  const AndersonWeights two = anderson(team, 4, f.data(), 2, [&](Index j) { return steps[std::size_t(j)].data(); });
  EXPECT_NEAR(two.gamma[0], 2, 1e-8);
  EXPECT_NEAR(two.gamma[1], -3, 1e-8);
  // One step alone: a'f / a'a = 9 / 6.
  EXPECT_NEAR(anderson(team, 4, f.data(), 1, [&](Index) { return steps[0].data(); }).gamma[0], 1.5, 1e-8);
  // A step remembered twice is shared out, not divided by zero.
  const AndersonWeights twice = anderson(team, 4, f.data(), 2, [&](Index) { return steps[0].data(); });
  EXPECT_NEAR(twice.gamma[0] + twice.gamma[1], 1.5, 1e-8);
  // Steps of no length prove nothing.
  const std::vector<double> nothing(4, 0.0);
  EXPECT_EQ(anderson(team, 4, f.data(), 1, [&](Index) { return nothing.data(); }).gamma[0], 0.0);
}

TEST(Admm, SmallSystemsHaveTheAnswersWorkedOutByHand) {
  expect_hand_answers(kSolver, 1e-10, 2000);
}

/// A column of n masses, the heaviest on top, each `ratio` times the one below.
Environment<double> column(std::size_t n, double ratio) {
  std::vector<double> A(n * n, 0.0), b(n, 0.0);
  double mass = 1;
  for (std::size_t i = 0; i < n; ++i) {
    A[i * n + i] += 1 / mass;
    if (i + 1 < n) {
      A[i * n + i + 1] -= 1 / mass;
      A[(i + 1) * n + i] -= 1 / mass;
      A[(i + 1) * n + i + 1] += 1 / mass;
    }
    mass *= ratio;
  }
  b[0] = -1;
  return system(std::vector<Cone>(n, unilateral()), A, b);
}

TEST(Admm, AHeavyTopOnLightMassesIsCarried) {
  for (const double ratio : {1.0, 10.0, 100.0}) {
    const Solution<double> solution = solve(batch_of({column(4, ratio)}), options(kSolver, 1e-8, 2000));
    EXPECT_EQ(solution.status[0].code, EnvCode::solved) << ratio << ": " << solution.status[0].residual;
    // Every contact carries the masses above it. Reactions of up to 1e6 leave w with rounding of 1e-10.
    double above = 0, mass = 1;
    for (int i = 0; i < 4; ++i, mass *= ratio) above += mass;
    mass = 1;
    for (std::size_t i = 0; i < 4; ++i) {
      EXPECT_NEAR(solution.lambda[i] / above, 1, 1e-4) << "ratio " << ratio << ", contact " << i;
      above -= mass;
      mass *= ratio;
    }
  }
}

TEST(Admm, ATallColumnTakesFarFewerIterationsThanSweeps) {
  const auto batch = batch_of({column(40, 1)});
  const Solution<double> ours = solve(batch, options(kSolver, 1e-8, 20000));
  const Solution<double> sweeps = solve(batch, options(SolverKind::npgs, 1e-8, 20000));
  ASSERT_EQ(ours.status[0].code, EnvCode::solved);
  EXPECT_LT(3 * ours.status[0].iterations, sweeps.status[0].iterations)
      << ours.status[0].iterations << " and " << sweeps.status[0].iterations;
}

TEST(Admm, RowsOfAnAsymmetricMatrixAreSolvedAsTheyAreUnderCoulombsLaw) {
  Recipe recipe;
  recipe.seed = 21;
  Environment<double> env = random_contacts(recipe);
  for (std::size_t k = 0; k < env.A.size(); ++k) env.A[k] *= 1 + 1e-3 * std::sin(static_cast<double>(k));
  Solution<double> solution;
  EXPECT_EQ(answer_violation(env, Law::coulomb, options(kSolver, 1e-9, 500), solution), "");
  EXPECT_EQ(solution.status[0].code, EnvCode::solved) << solution.status[0].residual;
}

TEST(Admm, AnEnvironmentTooLargeForAMatrixIsSolvedWithoutOne) {
  const auto n = static_cast<std::size_t>(kDirectRows) + 1;
  Environment<double> env;
  env.cones.assign(n, unilateral());
  env.b.assign(n, -1);
  for (std::size_t i = 1; i <= n; ++i) env.row_offsets.push_back(static_cast<Offset>(i));
  for (std::size_t i = 0; i < n; ++i) env.column.push_back(static_cast<Index>(i));
  env.A.assign(n, 1);
  const Solution<double> solution = solve(batch_of({env}), options(kSolver, 1e-6, 100));
  EXPECT_EQ(solution.status[0].code, EnvCode::solved);
  EXPECT_EQ(solution.status[0].flags, 0U);
  for (const double x : solution.lambda) EXPECT_NEAR(x, 1, 1e-5);
}

TEST(Admm, TheAnswerItselfIsTheBestStart) {
  Recipe recipe;
  recipe.seed = 8;
  recipe.contacts = 4;
  for (const Law law : kBothLaws) {
    const auto batch = batch_of({random_contacts(recipe)}, law);
    const Solution<double> cold = solve(batch, options(kSolver, 1e-8, 2000));
    const Solution<double> warm =
        solve(batch, options(kSolver, 1e-6, 2000), Device::cpu(), std::span<const double>(cold.lambda));
    EXPECT_GT(cold.status[0].iterations, 4);
    EXPECT_EQ(warm.status[0].iterations, 0) << to_string(law);
    std::vector<double> near = cold.lambda;
    for (double& value : near) value *= 1.001;
    const Solution<double> close =
        solve(batch, options(kSolver, 1e-6, 2000), Device::cpu(), std::span<const double>(near));
    EXPECT_LT(close.status[0].iterations, cold.status[0].iterations) << to_string(law);
  }
}

}  // namespace
