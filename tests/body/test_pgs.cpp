#include <gtest/gtest.h>

#include "stiction/error.hpp"
#include "tests/support/hand_answers.hpp"
#include "tests/support/random_checks.hpp"

#if defined(STICTION_TEST_HAS_RAPIDCHECK)
#include <rapidcheck/gtest.h>
#endif

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

#if defined(STICTION_TEST_HAS_RAPIDCHECK)

Recipe any_recipe() {
  Recipe recipe;
  recipe.seed = *rc::gen::arbitrary<std::uint64_t>();
  recipe.contacts = *rc::gen::inRange(0, 4);
  recipe.others = *rc::gen::inRange(recipe.contacts == 0 ? 1 : 0, 4);
  return recipe;
}

RC_GTEST_PROP(PgsRandom, PositiveDefiniteSystemsHaveTheOraclesMotion, ()) {
  Recipe recipe = any_recipe();
  recipe.mass_ratio = *rc::gen::element(1.0, 10.0, 100.0);
  const std::string violation = convex_violation(random_contacts(recipe), options(kSolver, 1e-8, 5000));
  if (!violation.empty()) RC_FAIL(violation);
}

RC_GTEST_PROP(PgsRandom, SingularSystemsWithComplianceHaveTheOraclesMotion, ()) {
  Recipe recipe = any_recipe();
  recipe.rank = 0.6;
  const std::string violation = convex_violation(random_contacts(recipe), options(kSolver, 1e-8, 5000));
  if (!violation.empty()) RC_FAIL(violation);
}

RC_GTEST_PROP(PgsRandom, SingularSystemsAreAnsweredHonestly, ()) {
  Recipe recipe = any_recipe();
  recipe.rank = 0.5;
  recipe.compliance = 0;
  for (const Law law : kBothLaws) {
    Solution<double> solution;
    const std::string violation = answer_violation(random_contacts(recipe), law, options(kSolver, 1e-6, 300), solution);
    if (!violation.empty()) RC_FAIL(label(kSolver, law) + ": " + violation);
  }
}

RC_GTEST_PROP(PgsRandom, WhereCoulombsSolutionIsUniqueItIsTheOracles, ()) {
  Recipe recipe = any_recipe();
  recipe.mu_max = 0.3;
  const std::string violation = coulomb_violation(random_conditioned(recipe, 9.0), options(kSolver, 1e-10, 5000));
  if (!violation.empty()) RC_FAIL(violation);
}

#endif

}  // namespace
