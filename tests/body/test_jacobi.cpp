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
  // Two islands whose masses differ by 1e6: each gets a step of its own.
  const auto env = system({unilateral(), unilateral()}, diagonal({1, 1e-6}), {-1, -1});
  const Solution<double> solution = solve(batch_of({env}), options(kSolver, 1e-12, 50));
  EXPECT_EQ(solution.status[0].code, EnvCode::solved) << solution.status[0].residual;
  EXPECT_NEAR(solution.lambda[1], 1e6, 1e-3);
}

#if defined(STICTION_TEST_HAS_RAPIDCHECK)

Recipe any_recipe() {
  Recipe recipe;
  recipe.seed = *rc::gen::arbitrary<std::uint64_t>();
  recipe.contacts = *rc::gen::inRange(0, 4);
  recipe.others = *rc::gen::inRange(recipe.contacts == 0 ? 1 : 0, 4);
  return recipe;
}

RC_GTEST_PROP(JacobiRandom, PositiveDefiniteSystemsHaveTheOraclesMotion, ()) {
  Recipe recipe = any_recipe();
  recipe.mass_ratio = *rc::gen::element(1.0, 10.0, 100.0);
  const std::string violation = convex_violation(random_contacts(recipe), options(kSolver, 1e-8, 5000));
  if (!violation.empty()) RC_FAIL(violation);
}

RC_GTEST_PROP(JacobiRandom, SingularSystemsWithComplianceHaveTheOraclesMotion, ()) {
  Recipe recipe = any_recipe();
  recipe.rank = 0.6;
  const std::string violation = convex_violation(random_contacts(recipe), options(kSolver, 1e-8, 5000));
  if (!violation.empty()) RC_FAIL(violation);
}

RC_GTEST_PROP(JacobiRandom, SingularSystemsAreAnsweredHonestly, ()) {
  Recipe recipe = any_recipe();
  recipe.rank = 0.5;
  recipe.compliance = 0;
  for (const Law law : kBothLaws) {
    Solution<double> solution;
    const std::string violation = answer_violation(random_contacts(recipe), law, options(kSolver, 1e-6, 300), solution);
    if (!violation.empty()) RC_FAIL(label(kSolver, law) + ": " + violation);
  }
}

RC_GTEST_PROP(JacobiRandom, WhereCoulombsSolutionIsUniqueItIsTheOracles, ()) {
  Recipe recipe = any_recipe();
  recipe.mu_max = 0.3;
  const std::string violation = coulomb_violation(random_conditioned(recipe, 9.0), options(kSolver, 1e-10, 5000));
  if (!violation.empty()) RC_FAIL(violation);
}

#endif

}  // namespace
