#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <span>

#include "stiction/residual.hpp"
#include "tests/support/oracles/oracle.hpp"
#include "tests/support/systems/random_systems.hpp"
#include "tests/support/systems/small_systems.hpp"

// The oracle is held to account first; then solvers' answers to problems whose every solution is known.

namespace {

using namespace stiction;
using namespace stiction::test;

Recipe frictionless(std::uint64_t seed, int rows) {
  Recipe recipe;
  recipe.seed = seed;
  recipe.contacts = 0;
  recipe.others = rows;
  recipe.unilateral_only = true;
  recipe.compliance = 0;
  return recipe;
}

TEST(Oracle, ItsTwoMethodsAgreeOnFrictionlessSystems) {
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    const auto env = random_contacts(frictionless(seed, 2 + static_cast<int>(seed % 7)));
    const auto gradient = oracle::solve_convex(env);
    const auto bases = oracle::solve_lcp_by_enumeration(env);
    ASSERT_TRUE(gradient.converged) << "seed " << seed << ": " << gradient.residual;
    ASSERT_FALSE(bases.empty()) << "seed " << seed;
    for (std::size_t i = 0; i < env.b.size(); ++i) EXPECT_NEAR(gradient.w[i], bases[0].w[i], 1e-9) << "seed " << seed;
  }
}

TEST(Oracle, TheJudgeFindsNoResidualInItsAnswers) {
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    Recipe recipe;
    recipe.seed = seed;
    const auto convex_env = random_contacts(recipe);
    const auto convex = oracle::solve_convex(convex_env);
    ASSERT_TRUE(convex.converged) << "seed " << seed;
    EXPECT_LE(verify(batch_of({convex_env}).view(), std::span<const double>(convex.lambda)).at(0).relative, 1e-12);
    recipe.mu_max = 0.3;
    const auto coulomb_env = random_conditioned(recipe, 9.0);
    const auto coulomb = oracle::solve_coulomb(coulomb_env);
    ASSERT_TRUE(coulomb.converged) << "seed " << seed;
    EXPECT_LE(
        verify(batch_of({coulomb_env}, Law::coulomb).view(), std::span<const double>(coulomb.lambda)).at(0).relative,
        1e-12);
  }
}

TEST(Oracle, EnumerationFindsEverySolutionOfAnUnsymmetricSystem) {
  // Two active sets solve this one: lambda = (0, 0) and (1, 1) (A = [0 1; 1 0] shifted, b = -1 off the diagonal).
  const auto env = system({unilateral(), unilateral()}, {1, -2, -2, 1}, {1, 1});
  const auto bases = oracle::solve_lcp_by_enumeration(env);
  ASSERT_EQ(bases.size(), 2U);
  EXPECT_EQ(bases[0].lambda, (std::vector<double>{0, 0}));
  EXPECT_EQ(bases[1].lambda, (std::vector<double>{1, 1}));
}

TEST(AgainstOracle, EverySolverFindsTheMotionThatEnumerationFinds) {
  for (const SolverKind solver : kAllSolvers) {
    int solved = 0;
    for (std::uint64_t seed = 1; seed <= 80; ++seed) {
      SCOPED_TRACE(std::string(to_string(solver)) + ", seed " + std::to_string(seed));
      Recipe recipe = frictionless(seed, 2 + static_cast<int>(seed % 7));
      const auto env = random_conditioned(recipe, 9.0);
      const auto solution = solve(batch_of({env}), options(solver, 1e-11, 20000));
      solved += solution.status[0].code == EnvCode::solved;
      const auto bases = oracle::solve_lcp_by_enumeration(env);
      ASSERT_EQ(bases.size(), 1U) << "a positive definite matrix has one solution";
      // Reactions are within (1 + L) / m of the residual, L = 9 and m = 1, and w within L of that.
      for (std::size_t i = 0; i < env.b.size(); ++i) EXPECT_NEAR(solution.w[i], bases[0].w[i], 90 * 3 * 1e-11);
    }
    EXPECT_EQ(solved, 80) << to_string(solver);
  }
}

TEST(AgainstOracle, SinglePrecisionIsAsGoodAsItsOwnRounding) {
  for (const SolverKind solver : kAllSolvers)
    for (std::uint64_t seed = 1; seed <= 40; ++seed) {
      SCOPED_TRACE(std::string(to_string(solver)) + ", seed " + std::to_string(seed));
      Recipe recipe;
      recipe.seed = seed;
      recipe.mu_max = 0.3;
      const auto env = random_conditioned(recipe, 9.0);
      const auto truth = oracle::solve_convex(env);
      const auto solution = solve(convert<float>(batch_of({env})), options(solver, 1e-5, 20000));
      EXPECT_EQ(solution.status[0].code, EnvCode::solved) << solution.status[0].residual;
      // Residual 1e-5 through the condition number in circular coordinates, 9 / 0.03^2, would allow 0.1. It measures w
      // of the rows that are not scaled, normals and single rows, which the condition 9 alone bounds.
      std::size_t row = 0;
      for (const auto& cone : env.cones) {
        EXPECT_NEAR(static_cast<double>(solution.w[row]), truth.w[row], 90 * 4 * 1e-5);
        row += static_cast<std::size_t>(cone.row_count);
      }
    }
}

}  // namespace
