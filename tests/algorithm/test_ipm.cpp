#include <gtest/gtest.h>

#include <limits>
#include <vector>

#include "tests/support/machines/solve_alone.hpp"
#include "tests/support/oracles/certificate.hpp"
#include "tests/support/oracles/hand_answers.hpp"
#include "tests/support/systems/random_systems.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

template <class Real>
Solution<Real> solved(const Environment<double>& env, Law law, double tolerance, Index iterations,
                      const AloneRules& rules = {}) {
  return solved_alone<Real>(env, options(SolverKind::ipm, tolerance, iterations), law, rules);
}

template <class Real>
void expect_answers_by_hand(double residual, double tolerance) {
  for (const HandAnswer& hand : hand_answers()) {
    SCOPED_TRACE(hand.why + " (" + to_string(hand.law) + ")");
    const Solution<Real> solution = solved<Real>(hand.env, hand.law, residual, 200);
    EXPECT_EQ(solution.status[0].code, EnvCode::solved) << "residual " << solution.status[0].residual;
    for (std::size_t i = 0; i < hand.w.size(); ++i) {
      EXPECT_NEAR(static_cast<double>(solution.lambda[i]), hand.lambda[i], tolerance) << "lambda of row " << i;
      EXPECT_NEAR(static_cast<double>(solution.w[i]), hand.w[i], tolerance) << "w of row " << i;
    }
  }
}

TEST(Ipm, SmallSystemsHaveTheAnswersWorkedOutByHand) {
  expect_answers_by_hand<double>(1e-12, 1e-11);
}
TEST(Ipm, InSinglePrecisionToo) {
  expect_answers_by_hand<float>(1e-6, 1e-5);
}

/// The answer of a convex problem is one by the law itself, and was not long in coming.
void expect_certified(const Environment<double>& env, long double bound) {
  for (const bool dense : {true, false}) {
    const Solution<double> solution =
        dense ? solved<double>(env, Law::convex, 1e-11, 100) : solved<double>(env, Law::convex, 1e-11, 100, kSparse);
    const Certificate found = certify(env, Law::convex, solution.lambda);
    EXPECT_LE(found.worst(), bound) << (dense ? "dense" : "sparse") << ": primal " << found.primal << ", dual "
                                    << found.dual << ", complementarity " << found.complementarity << ", status "
                                    << to_string(solution.status[0].code) << " after " << solution.status[0].iterations
                                    << " at " << solution.status[0].residual;
    EXPECT_LE(solution.status[0].iterations, 60);
  }
}

TEST(Ipm, RandomConvexProblemsAreCertified) {
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Recipe recipe;
    recipe.seed = seed;
    recipe.contacts = static_cast<int>(seed % 5);
    recipe.others = 3;
    recipe.mass_ratio = seed % 3 == 0 ? 100.0 : 10.0;
    expect_certified(random_contacts(recipe), 1e-10L);
  }
}

TEST(Ipm, RedundantContactsWithoutComplianceAreCertified) {
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Recipe recipe;
    recipe.seed = seed;
    recipe.contacts = 6;
    recipe.rank = 0.4;
    recipe.compliance = 0;
    expect_certified(random_contacts(recipe), 1e-10L);
  }
}

TEST(Ipm, MassesSixOrdersApartAreCertified) {
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Recipe recipe;
    recipe.seed = seed;
    recipe.contacts = 4;
    recipe.rank = 0.8;
    recipe.compliance = 0;
    recipe.mass_ratio = 1e6;
    expect_certified(random_contacts(recipe), 1e-9L);
  }
}

TEST(Ipm, BoundsOfEveryKind) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const double bounds[][2] = {{-1, 1},        {-1, kInfinity}, {-kInfinity, 1}, {-kInfinity, kInfinity},
                              {0.5, 0.5},     {0.25, 0.75},    {-3, -2},        {-1e-9, 1e-9},
                              {0, kInfinity}, {-1e12, 1e12},   {2, kInfinity},  {0, 0}};
  for (const double push : {-4.0, -0.1, 0.0, 0.1, 4.0}) {
    SCOPED_TRACE(push);
    const Environment<double> env = chain_of_boxes(bounds, push);
    const Solution<double> solution = solved<double>(env, Law::convex, 0, 100);
    const Certificate found = certify(env, Law::convex, solution.lambda);
    EXPECT_LE(found.primal, 0.0L);
    EXPECT_LE(found.dual, 1e-11L);
    // Rounding of a motion of size one, times the bound of 1e12.
    EXPECT_LE(found.complementarity, 1e-3L);
    EXPECT_LE(solution.status[0].residual, 1e-12);
  }
}

TEST(Ipm, WithoutForcesTheNearestPointOfTheBoundsIsTheAnswer) {
  Environment<double> env = system({box(), unilateral(), friction(3)}, diagonal({1, 1, 1, 1, 1}), {0, 0, 0, 0, 0});
  env.mu = {0, 0, 0, 0.5, 0.5};
  env.lo = {2, 0, 0, 0, 0};
  env.hi = {3, 0, 0, 0, 0};
  const Solution<double> solution = solved<double>(env, Law::convex, 0, 60);
  const double expected[] = {2, 0, 0, 0, 0};
  for (std::size_t i = 0; i < 5; ++i) EXPECT_NEAR(solution.lambda[i], expected[i], 1e-12) << i;
}

TEST(Ipm, FewIterationsAreEnoughAndMoreAreNotDone) {
  const Environment<double> env = random_contacts({.seed = 5, .contacts = 5});
  EXPECT_LE(solved<double>(env, Law::convex, 1e-8, 100).status[0].iterations, 20);
  // At tolerance zero it ends when nothing improves any more.
  const Solution<double> exact = solved<double>(env, Law::convex, 0, 1000);
  EXPECT_NE(exact.status[0].code, EnvCode::max_iterations);
  EXPECT_LT(exact.status[0].residual, 1e-13);
}

TEST(Ipm, AProblemWithoutAnAnswerEndsWithFiniteNumbers) {
  // Nothing resists and the contact is pulled in: unbounded below.
  const Environment<double> env = system({unilateral(), unilateral()}, diagonal({1, 0}), {-1, -1});
  const Solution<double> solution = solved<double>(env, Law::convex, 1e-8, 500);
  EXPECT_NE(solution.status[0].code, EnvCode::solved);
  for (const double x : solution.lambda) EXPECT_TRUE(std::isfinite(x)) << x;
}

TEST(Ipm, CoulombsLawIsReachedWhereItsSolutionIsUnique) {
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Recipe recipe;
    recipe.seed = seed;
    recipe.contacts = 4;
    recipe.mu_max = 0.3;
    const Environment<double> env = random_conditioned(recipe, 9.0);
    const Solution<double> solution = solved<double>(env, Law::coulomb, 1e-10, 300);
    EXPECT_EQ(solution.status[0].code, EnvCode::solved) << solution.status[0].residual;
    const Certificate found = certify(env, Law::coulomb, solution.lambda);
    EXPECT_LE(found.worst(), 1e-9L) << "primal " << found.primal << ", dual " << found.dual << ", complementarity "
                                    << found.complementarity;
  }
}

}  // namespace
