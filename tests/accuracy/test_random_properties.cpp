#include <gtest/gtest.h>

#if defined(STICTION_TEST_HAS_RAPIDCHECK)
#include <rapidcheck.h>

#include "tests/support/oracles/random_always.hpp"
#include "tests/support/oracles/random_checks.hpp"

/// Properties of every system that a random recipe makes, for each solver that promises them.
namespace stiction::test {
namespace {

/// Requirements of a solver beside its law.
struct Subject {
  SolverKind solver;
  double most_mass_ratio;  ///< up to which the iterations are enough for 1e-8
  Index iterations;        ///< sweeps are cheap and sometimes many
  double omega;            ///< below 1 the residual falls gradually: at 0 the oracle's own rounding would show
  bool always;             ///< whether every system is solved; others leave one of many thousands
};

std::string name_of(const testing::TestParamInfo<Subject>& subject) {
  return to_string(subject.param.solver);
}

SolverOptions asked_of(const Subject& subject, double tolerance, Index iterations) {
  SolverOptions asked = options(subject.solver, tolerance, iterations);
  asked.omega = subject.omega;
  return asked;
}

Recipe any_recipe() {
  Recipe recipe;
  recipe.seed = *rc::gen::arbitrary<std::uint64_t>();
  recipe.contacts = *rc::gen::inRange(0, 4);
  recipe.others = *rc::gen::inRange(recipe.contacts == 0 ? 1 : 0, 4);
  return recipe;
}

using ConvexSolvers = testing::TestWithParam<Subject>;
using SingularSolvers = testing::TestWithParam<Subject>;
using Solvers = testing::TestWithParam<Subject>;
using CoulombSolvers = testing::TestWithParam<Subject>;

TEST_P(ConvexSolvers, PositiveDefiniteSystemsHaveTheOraclesMotion) {
  expect_always(GetParam().always, [&](std::string& unsolved) {
    Recipe recipe = any_recipe();
    recipe.mass_ratio = *rc::gen::element(1.0, 10.0, GetParam().most_mass_ratio);
    return convex_violation(random_contacts(recipe), asked_of(GetParam(), 1e-8, GetParam().iterations), unsolved);
  });
}

TEST_P(SingularSolvers, SystemsWithComplianceHaveTheOraclesMotion) {
  expect_always(GetParam().always, [&](std::string& unsolved) {
    Recipe recipe = any_recipe();
    recipe.rank = 0.6;
    return convex_violation(random_contacts(recipe), asked_of(GetParam(), 1e-8, GetParam().iterations), unsolved);
  });
}

TEST_P(Solvers, SingularSystemsAreAnsweredHonestly) {
  expect_always(GetParam().always, [&](std::string&) {
    Recipe recipe = any_recipe();
    recipe.rank = 0.5;
    recipe.compliance = 0;
    std::string violations;
    for (const Law law : kBothLaws) {
      Solution<double> solution;
      const std::string violation =
          answer_violation(random_contacts(recipe), law, asked_of(GetParam(), 1e-6, 300), solution);
      if (!violation.empty()) violations += std::string(to_string(law)) + ": " + violation;
    }
    return violations;
  });
}

TEST_P(CoulombSolvers, WhereCoulombsSolutionIsUniqueItIsTheOracles) {
  expect_always(GetParam().always, [&](std::string& unsolved) {
    Recipe recipe = any_recipe();
    recipe.mu_max = 0.3;
    return coulomb_violation(random_conditioned(recipe, 9.0), asked_of(GetParam(), 1e-10, GetParam().iterations),
                             unsolved);
  });
}

/// Pivoting takes no friction cone, and rows of all other kinds.
TEST(Lemke, SystemsWithoutFrictionHaveTheOraclesMotion) {
  expect_always(true, [](std::string& unsolved) {
    Recipe recipe;
    recipe.seed = *rc::gen::arbitrary<std::uint64_t>();
    recipe.contacts = 0;
    recipe.others = *rc::gen::inRange(1, 12);
    recipe.rank = *rc::gen::element(0.6, 1.5);
    recipe.mass_ratio = *rc::gen::element(1.0, 100.0, 10000.0);
    return convex_violation(random_contacts(recipe), options(SolverKind::lemke, 1e-10, 1000), unsolved);
  });
}

constexpr Index kFew = 5000, kMany = 500000;
constexpr Subject kPgs{SolverKind::pgs, 100.0, kMany, 1.0, false};
constexpr Subject kNpgs{SolverKind::npgs, 100.0, kMany, 1.0, false};
constexpr Subject kJacobi{SolverKind::jacobi, 100.0, kMany, 1.0, false};
constexpr Subject kApgd{SolverKind::apgd, 100.0, kMany, 1.0, false};
constexpr Subject kNsgs{SolverKind::nsgs, 100.0, kMany, 0.8, false};
constexpr Subject kAdmm{SolverKind::admm, 10000.0, kFew, 1.0, false};
constexpr Subject kSubspace{SolverKind::subspace, 100.0, kFew, 1.0, false};
constexpr Subject kNewton{SolverKind::newton, 10000.0, kFew, 1.0, true};
constexpr Subject kIpm{SolverKind::ipm, 10000.0, kFew, 1.0, false};
constexpr Subject kAuto{SolverKind::automatic, 10000.0, kFew, 1.0, true};

const auto kConvex = testing::Values(kPgs, kNpgs, kJacobi, kApgd, kNsgs, kAdmm, kSubspace, kNewton, kIpm, kAuto);
const auto kCoulomb = testing::Values(kPgs, kNpgs, kJacobi, kApgd, kNsgs, kAdmm, kSubspace, kNewton, kIpm, kAuto);
INSTANTIATE_TEST_SUITE_P(Random, ConvexSolvers, kConvex, name_of);
INSTANTIATE_TEST_SUITE_P(Random, SingularSolvers, kConvex, name_of);
INSTANTIATE_TEST_SUITE_P(Random, Solvers, kConvex, name_of);
INSTANTIATE_TEST_SUITE_P(Random, CoulombSolvers, kCoulomb, name_of);

}  // namespace
}  // namespace stiction::test

#else

TEST(RandomProperties, NeedRapidcheck) {
  GTEST_SKIP() << "built without rapidcheck (Debian: librapidcheck-dev)";
}

#endif
