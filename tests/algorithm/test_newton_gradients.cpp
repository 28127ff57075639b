#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "core/algorithm/solver/newton/newton.hpp"
#include "scenes/scenes.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/machines/matrixless.hpp"
#include "tests/support/machines/solve_alone.hpp"
#include "tests/support/machines/solve_on_lanes.hpp"
#include "tests/support/oracles/certificate.hpp"
#include "tests/support/oracles/oracle.hpp"
#include "tests/support/systems/factor_systems.hpp"
#include "tests/support/systems/random_systems.hpp"

/// Newton's method whose steps come from gradients, as in environments that have no room for a matrix.
namespace {

using namespace stiction;
using namespace stiction::test;

Solution<double> without_matrices(const Environment<double>& env, Law law, double tolerance, Index iterations) {
  return solved_alone(env, options(SolverKind::newton, tolerance, iterations), law, kSparseWithoutMatrices);
}

Environment<double> some_contacts(std::uint64_t seed, double rank, double compliance) {
  Recipe recipe;
  recipe.seed = seed;
  recipe.contacts = 4;
  recipe.others = 3;
  recipe.rank = rank;
  recipe.compliance = compliance;
  recipe.mu_max = 0.6;
  return random_contacts(recipe);
}

TEST(NewtonGradients, CompliantSystemsHaveTheOraclesAnswerEvenIfTheyAreSingular) {
  for (const double rank : {1.5, 0.5})
    for (std::uint64_t seed = 0; seed < 10; ++seed) {
      SCOPED_TRACE(testing::Message() << "rank " << rank << ", seed " << seed);
      const Environment<double> env = some_contacts(seed, rank, 0.01);
      const auto found = without_matrices(env, Law::convex, 1e-10, 60);
      EXPECT_EQ(found.status[0].code, EnvCode::solved) << found.status[0].residual;
      EXPECT_LE(found.status[0].iterations, 30);
      const oracle::Answer truth = oracle::solve_convex(env);
      ASSERT_TRUE(truth.converged);
      // As in test_newton.cpp: the residual of either is amplified by some 1e4.
      for (std::size_t i = 0; i < env.b.size(); ++i) EXPECT_NEAR(found.w[i], truth.w[i], 1e-5) << "row " << i;
    }
}

TEST(NewtonGradients, ATowerWithLittleComplianceTakesFewerIterationsThanItHasContacts) {
  Environment<double> env = scenes::make("stack", 5, 0, 8).system;
  env.R.assign(env.b.size(), 1e-3);
  const auto by_matrix = solve(batch_of({env}), options(SolverKind::newton, 1e-9, 100));
  const auto found = without_matrices(env, Law::convex, 1e-9, 100);
  EXPECT_EQ(found.status[0].code, EnvCode::solved) << found.status[0].residual;
  EXPECT_LE(found.status[0].iterations, 2 * by_matrix.status[0].iterations + 10);
  double size = 0;
  for (const double x : by_matrix.lambda) size = std::max(size, std::abs(x));
  // Off by the residual over R.
  for (std::size_t i = 0; i < env.b.size(); ++i)
    EXPECT_NEAR(found.lambda[i], by_matrix.lambda[i], 1e-4 * size) << "row " << i;
}

TEST(NewtonGradients, RigidSystemsUnderBothLaws) {
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    SCOPED_TRACE(seed);
    const Environment<double> env = some_contacts(seed, 1.5, 0.0);
    const auto convex = without_matrices(env, Law::convex, 1e-9, 100);
    EXPECT_EQ(convex.status[0].code, EnvCode::solved) << convex.status[0].residual;
    EXPECT_LE(certify(env, Law::convex, convex.lambda).worst(), 1e-7L);
    const auto coulomb = without_matrices(env, Law::coulomb, 1e-9, 100);
    EXPECT_EQ(coulomb.status[0].code, EnvCode::solved) << coulomb.status[0].residual;
    EXPECT_LE(certify(env, Law::coulomb, coulomb.lambda).worst(), 1e-7L);
  }
}

TEST(NewtonGradients, FactorsInBothBranchesAndInSinglePrecision) {
  JacobianRecipe recipe;
  recipe.seed = 3;
  recipe.contacts = 8;
  recipe.others = 4;
  recipe.dofs = 18;
  const JacobianEnvironment<double> contacts = random_jacobian(recipe);
  const Environment<double> env = as_matrix(contacts);
  const SolverOptions o = options(SolverKind::newton, 1e-9, 200);
  const auto primal = solve_alone(as_factor(contacts, Law::convex), o, 0, kWithoutMatrices);
  EXPECT_EQ(primal.status[0].code, EnvCode::solved) << primal.status[0].residual;
  EXPECT_LE(certify(env, Law::convex, primal.lambda).worst(), 1e-7L);
  const auto proximal = solve_alone(as_factor(contacts, Law::coulomb), o, 0, kWithoutMatrices);
  EXPECT_EQ(proximal.status[0].code, EnvCode::solved) << proximal.status[0].residual;
  EXPECT_LE(certify(env, Law::coulomb, proximal.lambda).worst(), 1e-7L);
  const auto narrow = solve_alone(convert<float>(as_factor(contacts, Law::convex)),
                                  options(SolverKind::newton, 1e-4, 200), 0, kWithoutMatrices);
  EXPECT_EQ(narrow.status[0].code, EnvCode::solved) << narrow.status[0].residual;
}

TEST(NewtonGradients, MoreRowsThanAMatrixMayHaveAreSolved) {
  Environment<double> env = scenes::make("stack", 5, 0, 90).system;
  ASSERT_GT(env.b.size(), static_cast<std::size_t>(kDirectRows));
  env.R.assign(env.b.size(), 1e-2);
  const Solution<double> primal = solve(batch_of({env}), options(SolverKind::newton, 1e-7, 100));
  EXPECT_EQ(primal.status[0].code, EnvCode::solved) << primal.status[0].residual;
  EXPECT_EQ(primal.status[0].flags, 0U);
  EXPECT_LE(certify(env, Law::convex, primal.lambda).worst(), 1e-5L);
  const Solution<double> coulomb = solve(batch_of({env}, Law::coulomb), options(SolverKind::newton, 1e-5, 200));
  EXPECT_EQ(coulomb.status[0].code, EnvCode::solved) << coulomb.status[0].residual;
  EXPECT_LE(certify(env, Law::coulomb, coulomb.lambda).worst(), 1e-3L);
}

TEST(NewtonGradients, BlocksAreInvertedWithExchangesAndWithoutAPivot) {
  // The first column's largest entry is in the last row, and after it the second's too.
  double K[3][3] = {{0, 2, 1}, {1, 0, 0}, {4, 0, 2}};
  double inverse[9];
  invert_cone_block(K, inverse);
  const double expected[9] = {0, 1, 0, 0.5, 1, -0.25, 0, -2, 0.5};
  for (int k = 0; k < 9; ++k) EXPECT_NEAR(inverse[k], expected[k], 1e-15) << k;
  double zero[2][2] = {{0, 0}, {0, 2}};
  double kept[4];
  invert_cone_block(zero, kept);
  for (const double entry : kept) EXPECT_TRUE(std::isfinite(entry));
  EXPECT_EQ(kept[3], 0.5);
}

template <Law kLaw, class Real>
void expect_same_on_teams(const ContactBatch<double>& wide, const std::string& what) {
  const ContactBatch<Real> batch = convert<Real>(wide);
  const SolverOptions o = options(SolverKind::newton, 1e-12, 2);
  const Solution<Real> alone = solve_alone(batch, o, 0, kWithoutMatrices);
  for (const Index width : {1, 2, 3, 8, 33})
    EXPECT_TRUE(same_bits(
        alone, solve_on_lanes<Matrixless<Newton>, kLaw, FactorSystem<Real>>(batch, o, width, width == 3 ? 42 : 0)))
        << what << ", width " << width;
}

TEST(Torture, NewtonByGradientsHasTheSameBitsOnBlocksOfEveryWidth) {
  // Small, because every step of gradients is a dozen barriers.
  JacobianRecipe recipe;
  recipe.contacts = 4;
  recipe.others = 2;
  recipe.dofs = 8;
  const JacobianEnvironment<double> contacts = random_jacobian(recipe);
  expect_same_on_teams<Law::convex, float>(as_factor(contacts, Law::convex), "primal");
  expect_same_on_teams<Law::coulomb, double>(as_factor(contacts, Law::coulomb), "proximal");
}

}  // namespace
