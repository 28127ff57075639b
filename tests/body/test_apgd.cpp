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

constexpr SolverKind kSolver = SolverKind::apgd;

TEST(Apgd, SmallSystemsHaveTheAnswersWorkedOutByHand) {
  expect_hand_answers(kSolver, 1e-10, 4000);
}

TEST(Apgd, ASystemThatIsNotSymmetricIsRefusedWithItsFlag) {
  const auto refused = system({unilateral(), unilateral()}, {2, -1, 0, 2}, {-1, -2});
  const Solution<double> solution = solve(batch_of({refused}), options(kSolver, 1e-6, 100));
  EXPECT_EQ(solution.status[0].code, EnvCode::unsupported);
  EXPECT_EQ(solution.status[0].flags, static_cast<std::uint32_t>(kFlagAsymmetric));
  EXPECT_EQ(solution.lambda, (std::vector<double>{0, 0}));
  EXPECT_EQ(solution.w, refused.b);
}

TEST(Apgd, TheAsymmetryOfRealFilesIsAccepted) {
  // 1e-3 of the largest entry, as recorded systems have it; 1e-2 is the limit.
  const auto accepted = system({unilateral(), unilateral()}, {2, 1, 1.002, 2}, {-1, -2});
  EXPECT_EQ(solve(batch_of({accepted}), options(kSolver, 1e-9, 500)).status[0].code, EnvCode::solved);
  const auto refused = system({unilateral(), unilateral()}, {2, 1, 1.03, 2}, {-1, -2});
  EXPECT_EQ(solve(batch_of({refused}), options(kSolver, 1e-9, 500)).status[0].code, EnvCode::unsupported);
}

TEST(Apgd, TheSparsePathRefusesWhatIsNotSymmetricToo) {
  // A hundred rows in a ring, each pulled by the one before and pulling none.
  constexpr Index kRows = 100;
  Environment<double> env;
  for (Index i = 0; i < kRows; ++i) {
    env.cones.push_back(unilateral());
    env.column.insert(env.column.end(), {i, (i + 1) % kRows});
    env.A.insert(env.A.end(), {2.0, -1.0});
    env.row_offsets.push_back(2 * (i + 1));
    env.b.push_back(-1);
  }
  const Solution<double> solution = solve(batch_of({env}), options(kSolver, 1e-6, 100));
  EXPECT_EQ(solution.status[0].code, EnvCode::unsupported);
  EXPECT_NE(solution.status[0].flags & kFlagAsymmetric, 0U);
}

TEST(Apgd, MassesAMillionApartAreEvenedOutByThePreconditioner) {
  const auto env = system({unilateral(), unilateral()}, diagonal({1, 1e-6}), {-1, -1});
  const Solution<double> solution = solve(batch_of({env}), options(kSolver, 1e-12, 100));
  EXPECT_EQ(solution.status[0].code, EnvCode::solved) << solution.status[0].residual;
}

#if defined(STICTION_TEST_HAS_RAPIDCHECK)

Recipe any_recipe() {
  Recipe recipe;
  recipe.seed = *rc::gen::arbitrary<std::uint64_t>();
  recipe.contacts = *rc::gen::inRange(0, 4);
  recipe.others = *rc::gen::inRange(recipe.contacts == 0 ? 1 : 0, 4);
  return recipe;
}

RC_GTEST_PROP(ApgdRandom, PositiveDefiniteSystemsHaveTheOraclesMotion, ()) {
  Recipe recipe = any_recipe();
  recipe.mass_ratio = *rc::gen::element(1.0, 10.0, 100.0);
  const std::string violation = convex_violation(random_contacts(recipe), options(kSolver, 1e-8, 5000));
  if (!violation.empty()) RC_FAIL(violation);
}

RC_GTEST_PROP(ApgdRandom, SingularSystemsWithComplianceHaveTheOraclesMotion, ()) {
  Recipe recipe = any_recipe();
  recipe.rank = 0.6;
  const std::string violation = convex_violation(random_contacts(recipe), options(kSolver, 1e-8, 5000));
  if (!violation.empty()) RC_FAIL(violation);
}

RC_GTEST_PROP(ApgdRandom, SingularSystemsAreAnsweredHonestly, ()) {
  Recipe recipe = any_recipe();
  recipe.rank = 0.5;
  recipe.compliance = 0;
  for (const Law law : kBothLaws) {
    Solution<double> solution;
    const std::string violation = answer_violation(random_contacts(recipe), law, options(kSolver, 1e-6, 300), solution);
    if (!violation.empty()) RC_FAIL(label(kSolver, law) + ": " + violation);
  }
}

RC_GTEST_PROP(ApgdRandom, WhereCoulombsSolutionIsUniqueItIsTheOracles, ()) {
  Recipe recipe = any_recipe();
  recipe.mu_max = 0.3;
  const std::string violation = coulomb_violation(random_conditioned(recipe, 9.0), options(kSolver, 1e-10, 5000));
  if (!violation.empty()) RC_FAIL(violation);
}

#endif

}  // namespace
