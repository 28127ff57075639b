// Boxed friction: answers by hand, by enumeration of all states, and by the law; refusals; hostile numbers.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <vector>

#include "stiction/box_friction.hpp"
#include "stiction/derivative.hpp"
#include "stiction/error.hpp"
#include "stiction/pyramid.hpp"
#include "stiction/residual.hpp"
#include "tests/support/oracles/box_friction_oracle.hpp"
#include "tests/support/systems/boxed.hpp"
#include "tests/support/systems/derivative_cases.hpp"
#include "tests/support/systems/factor_systems.hpp"
#include "tests/support/systems/random_systems.hpp"
#include "tests/support/systems/scene_batches.hpp"
#include "tests/support/systems/small_systems.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Solvers that take boxed friction, and those that refuse it.
const SolverKind kTake[] = {SolverKind::pgs,      SolverKind::npgs,  SolverKind::jacobi,   SolverKind::nsgs,
                            SolverKind::subspace, SolverKind::lemke, SolverKind::automatic};
const SolverKind kRefuse[] = {SolverKind::apgd, SolverKind::admm, SolverKind::newton, SolverKind::ipm};

Solution<double> solve_one(const Environment<double>& env, SolverKind solver, Law law = Law::convex,
                           double tolerance = 1e-12, Index iterations = 20000) {
  return solve(batch_of({env}, law), options(solver, tolerance, iterations));
}

/// Expects reactions of a contact of three rows with mu = 1/2 on the unit matrix, by every solver and under both laws.
void expect_reactions(const std::vector<double>& b, const std::vector<double>& lambda) {
  const Environment<double> env = boxed(contact({1, 1, 1}, b, 0.5));
  for (const SolverKind solver : kTake)
    for (const Law law : kBothLaws) {
      SCOPED_TRACE(label(solver, law));
      const Solution<double> solution = solve_one(env, solver, law);
      EXPECT_EQ(solution.status[0].code, EnvCode::solved);
      for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(solution.lambda[i], lambda[i], 1e-11) << i;
    }
}

// lambda_n = -b_n = 2, so each axis has [-1, 1] to itself, whatever the other one does.
TEST(BoxFriction, OneContactByHand) {
  expect_reactions({-2, 0.25, -0.5}, {2, -0.25, 0.5});  // sticks
  expect_reactions({-2, 3, -0.5}, {2, -1, 0.5});        // slides along one axis, sticks along the other
  expect_reactions({-2, 3, -4}, {2, -1, 1});            // a corner: sqrt(2) beyond Coulomb's disk
  expect_reactions({1, 3, -4}, {0, 0, 0});              // open, and sliding off freely
}

// A_nt = 1/2, mu = 1/2: the reaction on the axis pushes the normal apart. At the lower bound lambda_t = -lambda_n / 2,
// so w_n = lambda_n - lambda_n / 4 - 3 = 0 gives lambda_n = 4, lambda_t = -2, w_t = 2 - 2 + 5 = 5 >= 0.
TEST(BoxFriction, TheBoundIsThatOfTheAnswersOwnNormal) {
  Environment<double> env = system({{ConeKind::box_friction, 2, -1}}, {1, 0.5, 0.5, 1}, {-3, 5});
  env.mu = {0, 0.5};
  for (const SolverKind solver : kTake) {
    const Solution<double> solution = solve_one(env, solver);
    EXPECT_NEAR(solution.lambda[0], 4, 1e-10) << to_string(solver);
    EXPECT_NEAR(solution.lambda[1], -2, 1e-10) << to_string(solver);
    EXPECT_NEAR(solution.w[1], 5, 1e-10) << to_string(solver);
  }
}

TEST(BoxFriction, EveryFurtherAxisHasItsOwnBound) {
  Environment<double> env =
      system({{ConeKind::box_friction, 6, -1}}, diagonal({2, 1, 1, 1, 1, 1}), {-4, 10, -10, 0.001, 10, -10});
  env.mu = {0, 0.5, 0.25, 0.1, 0.01, 0};
  for (const SolverKind solver : kTake) {
    const Solution<double> solution = solve_one(env, solver);
    const double expected[] = {2, -1, 0.5, -0.001, -0.02, 0};
    for (std::size_t i = 0; i < 6; ++i) EXPECT_NEAR(solution.lambda[i], expected[i], 1e-9) << to_string(solver) << i;
  }
}

TEST(BoxFriction, TheJudgeByHand) {
  // a = 1, lambda = (2, 0, 0), w = (0, 3, -4).
  const auto batch = batch_of({boxed(contact({1, 1, 1}, {-2, 3, -4}, 0.5))});
  const auto judged = [&](std::vector<double> lambda) {
    return verify(batch.view(), std::span<const double>(lambda)).at(0).absolute;
  };
  // Each axis is 1 from the bound that its motion asks for.
  EXPECT_DOUBLE_EQ(judged({2, 0, 0}), std::sqrt(2.0));
  EXPECT_EQ(judged({2, -1, 1}), 0.0);
  EXPECT_GT(judged({2, -1, -1}), 1.0) << "held at the wrong side";
  EXPECT_DOUBLE_EQ(judged({2, -1.5, 1}), 0.5) << "outside";
  EXPECT_GT(judged({-1, 0, 0}), 1.0) << "the normal row pulls";
  const auto frictionless = batch_of({boxed(contact({1, 1, 1}, {-2, 3, -4}, 0))});
  EXPECT_EQ(verify(frictionless.view(), std::span<const double>(std::vector<double>{2, 0, 0})).at(0).absolute, 0.0);
  EXPECT_GT(verify(frictionless.view(), std::span<const double>(std::vector<double>{2, 1, 0})).at(0).absolute, 0.5);
}

/// A random system of few rows whose matrix has that condition number. Every third has so little motion along its axes
/// that contacts mostly stick.
Environment<double> small_random(std::uint64_t seed, double mu_max, double condition) {
  Recipe recipe;
  recipe.seed = seed;
  recipe.contacts = 2;
  recipe.others = 2;
  recipe.friction_rows = 2 + static_cast<Index>(seed % 2);
  recipe.mu_max = mu_max;
  Environment<double> env = boxed(random_conditioned(recipe, condition));
  std::size_t row = 0;
  for (const auto& cone : env.cones) {
    for (Index k = 1; seed % 3 == 0 && k < cone.row_count; ++k) env.b[row + static_cast<std::size_t>(k)] *= 0.05;
    row += static_cast<std::size_t>(cone.row_count);
  }
  return env;
}

TEST(BoxFriction, EverySolverFindsTheSolutionThatEnumerationFinds) {
  std::size_t at_a_bound = 0, inside = 0, open = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    const Environment<double> env = small_random(seed, 0.6, 3);
    const oracle::BoxFrictionStates states(env);
    ASSERT_EQ(states.found.size(), 1U) << "seed " << seed;
    const std::vector<double>& expected = states.found.front();
    EXPECT_LT(oracle::box_friction_violation(env, expected), 1e-12);
    std::size_t row = 0;
    for (const auto& cone : env.cones) {
      for (std::size_t k = 1; k < static_cast<std::size_t>(cone.row_count); ++k) {
        const double bound = env.mu[row + k] * expected[row];
        open += expected[row] == 0.0 ? 1U : 0U;
        at_a_bound += bound > 0 && std::abs(expected[row + k]) > 0.999999 * bound ? 1U : 0U;
        inside += bound > 0 && std::abs(expected[row + k]) < 0.999999 * bound ? 1U : 0U;
      }
      row += static_cast<std::size_t>(cone.row_count);
    }
    for (const SolverKind solver : kTake) {
      SCOPED_TRACE(std::string(to_string(solver)) + ", seed " + std::to_string(seed));
      const Solution<double> solution = solve_one(env, solver, seed % 2 == 0 ? Law::convex : Law::coulomb);
      EXPECT_EQ(solution.status[0].code, EnvCode::solved) << solution.status[0].residual;
      for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(solution.lambda[i], expected[i], 1e-9) << i;
    }
  }
  EXPECT_GT(at_a_bound, 20U);
  EXPECT_GT(inside, 10U);
  EXPECT_GT(open, 10U);
}

TEST(BoxFriction, MixedWithEveryOtherKindAnswersObeyTheLaw) {
  std::size_t solved = 0, asked = 0;
  for (std::uint64_t seed = 1; seed <= 24; ++seed) {
    Recipe recipe;
    recipe.seed = seed;
    recipe.contacts = 6;
    recipe.others = 4;
    recipe.mu_max = 0.5;
    for (const SolverKind solver : kTake)
      for (const Law law : kBothLaws) {
        // No friction cone is half lines.
        const Environment<double> env = boxed(random_conditioned(recipe, 4), solver == SolverKind::lemke);
        SCOPED_TRACE(label(solver, law) + ", seed " + std::to_string(seed));
        const auto batch = batch_of({env}, law);
        const Solution<double> solution = solve(batch, options(solver, 1e-11, 20000));
        ++asked;
        const Residual judged = verify(batch.view(), std::span<const double>(solution.lambda)).at(0);
        EXPECT_NEAR(judged.relative, solution.status[0].residual, 1e-13);
        if (solution.status[0].code != EnvCode::solved) continue;
        ++solved;
        EXPECT_LT(oracle::box_friction_violation(env, solution.lambda), 1e-9);
      }
  }
  EXPECT_EQ(solved, asked);
}

// Large mu, and normals that are coupled with axes: sweeps go around in circles.
TEST(BoxFriction, AutoFindsByPivotsWhatSweepsMiss) {
  std::size_t missed = 0;
  for (std::uint64_t seed = 1; seed <= 400; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Environment<double> env = small_random(seed, 3, 100);
    if (solve_one(env, SolverKind::subspace, Law::convex, 1e-10, 4096).status[0].code == EnvCode::solved) continue;
    const oracle::BoxFrictionStates states(env);
    if (states.found.size() != 1) continue;
    ++missed;
    for (const Law law : kBothLaws) {
      const Solution<double> solution = solve_one(env, SolverKind::automatic, law, 1e-10, 4096);
      EXPECT_EQ(solution.status[0].code, EnvCode::solved) << solution.status[0].residual;
      EXPECT_EQ(solution.status[0].solver, SolverKind::lemke);
      for (std::size_t i = 0; i < env.b.size(); ++i) EXPECT_NEAR(solution.lambda[i], states.found[0][i], 1e-9) << i;
    }
  }
  EXPECT_GT(missed, 5U);
}

TEST(BoxFriction, PivotsTakeWhatFitsAndSayWhatDoesNot) {
  const auto contacts = [](int count, bool all) {
    Recipe recipe;
    recipe.seed = 3;
    recipe.contacts = count;
    recipe.others = 0;
    recipe.friction_rows = 3;
    recipe.mu_max = 0.5;
    return boxed(random_conditioned(recipe, 4), all);
  };
  const Environment<double> most = contacts(13, true);
  const Solution<double> answer = solve_one(most, SolverKind::lemke, Law::convex, 1e-12, 1000);
  EXPECT_EQ(answer.status[0].code, EnvCode::solved);
  EXPECT_LT(oracle::box_friction_violation(most, answer.lambda), 1e-11);
  const auto flags = [](const Environment<double>& env) {
    const Solution<double> solution = solve_one(env, SolverKind::lemke);
    EXPECT_EQ(solution.status[0].code, EnvCode::unsupported);
    return solution.status[0].flags;
  };
  EXPECT_EQ(flags(contacts(14, true)), static_cast<std::uint32_t>(kFlagOverCapacity));
  EXPECT_EQ(flags(contacts(4, false)), static_cast<std::uint32_t>(kFlagUnsupportedCone));
}

TEST(BoxFriction, AsHalfLinesItIsAnsweredByLemke) {
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Environment<double> env = small_random(seed, 0.6, 3);
    if (seed % 4 == 0) std::fill(env.R.begin(), env.R.end(), 0.125);
    const std::vector<double> expected = oracle::BoxFrictionStates(env).found.at(0);
    const ContactBatch<double> batch = batch_of({env, env});
    const ComplementarityBatch<double> made = as_complementarity(batch);
    const Solution<double> solution = solve(made.batch, options(SolverKind::lemke, 1e-12, 1000));
    EXPECT_EQ(solution.status[0].code, EnvCode::solved);
    const std::vector<double> lambda = reactions(made, batch, std::span<const double>(solution.lambda));
    for (std::size_t i = 0; i < expected.size(); ++i) {
      EXPECT_NEAR(lambda[i], expected[i], 1e-10) << i;
      EXPECT_EQ(lambda[expected.size() + i], lambda[i]) << "the second environment, " << i;
    }
  }
  Environment<double> env = boxed(contact({1, 1, 1}, {-2, 3, -4}, 0.5));
  env.mu[1] = -1;
  EXPECT_THROW(as_complementarity(batch_of({env})), Error);
}

TEST(BoxFriction, SinglePrecisionAgreesWithDouble) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const Environment<double> env = small_random(seed, 0.6, 3);
    const auto batch = batch_of({env});
    const Solution<double> wide = solve(batch, options(SolverKind::npgs, 1e-12, 20000));
    const Solution<float> narrow = solve(convert<float>(batch), options(SolverKind::npgs, 1e-6, 20000));
    EXPECT_EQ(narrow.status[0].code, EnvCode::solved) << seed;
    for (std::size_t i = 0; i < wide.lambda.size(); ++i)
      EXPECT_NEAR(narrow.lambda[i], wide.lambda[i], 2e-5) << "seed " << seed << ", row " << i;
  }
}

// A from J and M, stored or as a factor, planned on the host and on the emulated device. auto does not give it to
// Newton's method in velocities, which would answer by Coulomb's law.
TEST(BoxFriction, FormsWithJacobiansAreAnsweredToo) {
  for (const SolverKind solver :
       {SolverKind::pgs, SolverKind::npgs, SolverKind::jacobi, SolverKind::lemke, SolverKind::automatic})
    for (const FactorUse use : {FactorUse::never, FactorUse::always}) {
      JacobianBatch<double> batch(Law::convex);
      std::vector<Environment<double>> matrices;
      for (std::uint64_t seed = 1; seed <= 5; ++seed) {
        JacobianRecipe recipe;
        recipe.seed = seed;
        recipe.dofs = 24;
        recipe.compliance = 0.2;
        JacobianEnvironment<double> env = random_jacobian(recipe);
        for (auto& cone : env.cones)
          if (cone.kind == ConeKind::friction) cone.kind = ConeKind::box_friction;
        batch.add(env);
        matrices.push_back(as_matrix(env));
      }
      SCOPED_TRACE(std::string(to_string(solver)) + (use == FactorUse::always ? ", factor" : ", A"));
      const SolverOptions own = options(solver, 1e-9, 20000);
      const auto found = solve(batch, own, Device::cpu(), {}, use);
      std::size_t row = 0;
      for (std::size_t e = 0; e < matrices.size(); ++e) {
        EXPECT_EQ(found.contact.status[e].code, EnvCode::solved) << e;
        EXPECT_NE(found.contact.status[e].solver, SolverKind::velocity_newton) << e;
        const auto first = found.contact.lambda.begin() + static_cast<std::ptrdiff_t>(row);
        const std::vector<double> lambda(first, first + static_cast<std::ptrdiff_t>(matrices[e].b.size()));
        EXPECT_LT(oracle::box_friction_violation(matrices[e], lambda), 1e-7) << e;
        row += matrices[e].b.size();
      }
      const auto emulated = solve(batch, own, Device::emulated(), {}, use);
      EXPECT_EQ(emulated.contact.lambda, found.contact.lambda) << "on the emulated device";
    }
}

TEST(BoxFriction, SolversOfOtherLawsSayThatTheyCannotTreatIt) {
  // Environment 1 has none: only those that have some are refused.
  const auto plain = contact({1, 1, 1}, {-2, 3, -4}, 0.5);
  for (const SolverKind solver : kRefuse) {
    SCOPED_TRACE(to_string(solver));
    const auto batch = batch_of({boxed(plain), plain});
    const Solution<double> solution = solve(batch, options(solver, 1e-8, 200));
    EXPECT_EQ(solution.status[0].code, EnvCode::unsupported);
    EXPECT_EQ(solution.status[0].flags, static_cast<std::uint32_t>(kFlagUnsupportedCone));
    EXPECT_EQ(solution.lambda[0], 0.0);
    EXPECT_EQ(solution.w[1], 3.0) << "w = b";
    EXPECT_EQ(solution.status[1].code, EnvCode::solved);
  }
}

TEST(BoxFriction, DerivativesAndPyramidsRefuseIt) {
  const auto batch = batch_of({boxed(contact({1, 1, 1}, {-2, 0.1, 0}, 0.5))});
  const Solution<double> solution = solve(batch, options(SolverKind::npgs, 1e-10, 100));
  const auto gradients = vjp(batch.view(), solution.lambda, {1.0, 1.0, 1.0}, {}, DerivativeOptions{});
  EXPECT_EQ(gradients.status[0].flags & kGradientInvalidInput, static_cast<std::uint32_t>(kGradientInvalidInput));
  EXPECT_EQ(gradients.b, std::vector<double>(3, 0.0));
  try {
    linearise(batch, 4);
    FAIL() << "made a pyramid of a box";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::unsupported);
  }
}

TEST(BoxFriction, AWarmStartBeginsInsideItsBox) {
  const Environment<double> env = boxed(contact({1, 1, 1}, {-2, 3, -4}, 0.5));
  const std::vector<double> warm = {4, -100, 1};
  for (const SolverKind solver : kTake) {
    const Solution<double> solution =
        solve(batch_of({env}), options(solver, 0, 0), Device::cpu(), std::span<const double>(warm));
    EXPECT_EQ(solution.lambda, (std::vector<double>{4, -2, 1})) << to_string(solver);
  }
  const std::vector<double> pulled = {-4, -100, 1};
  const Solution<double> solution =
      solve(batch_of({env}), options(SolverKind::npgs, 0, 0), Device::cpu(), std::span<const double>(pulled));
  EXPECT_EQ(solution.lambda, (std::vector<double>{0, 0, 0}));
}

TEST(BoxFriction, HostileNumbersAreFlaggedWhereTheyAreOrAnswered) {
  const Environment<double> sound = boxed(contact({1, 1, 1}, {-2, 3, -4}, 0.5));
  const auto flags_of = [&](double mu) {
    Environment<double> env = sound;
    env.mu[2] = mu;
    SolverOptions isolating = options(SolverKind::npgs, 1e-8, 100);
    isolating.invalid = InvalidPolicy::isolate;
    const Solution<double> solution = solve(batch_of({sound, env, sound}), isolating);
    EXPECT_EQ(solution.status[0].code, EnvCode::solved);
    EXPECT_EQ(solution.status[2].code, EnvCode::solved);
    for (std::size_t i = 3; i < 6; ++i) EXPECT_TRUE(std::isfinite(solution.lambda[i]));
    return solution.status[1].flags;
  };
  EXPECT_EQ(flags_of(kNan), static_cast<std::uint32_t>(kFlagNonFiniteInput));
  EXPECT_EQ(flags_of(kInfinity), static_cast<std::uint32_t>(kFlagNonFiniteInput));
  EXPECT_EQ(flags_of(-0.5), static_cast<std::uint32_t>(kFlagNegativeFriction));
  EXPECT_EQ(flags_of(0.0), 0U);
  EXPECT_EQ(flags_of(1e-300), 0U);
  EXPECT_THROW(
      [&] {
        Environment<double> env = sound;
        env.mu[1] = -1;
        solve(batch_of({env}), options(SolverKind::npgs, 1e-8, 100));
      }(),
      Error);
  // A row that couples to nothing slides to its bound.
  Environment<double> loose = boxed(contact({1, 0, 1}, {-2, 3, -4}, 0.5));
  for (const SolverKind solver : kTake) {
    SolverOptions isolating = options(solver, 1e-10, 20000);
    isolating.invalid = InvalidPolicy::isolate;
    const Solution<double> solution = solve(batch_of({loose}), isolating);
    EXPECT_EQ(solution.status[0].code, EnvCode::solved) << to_string(solver);
    EXPECT_NEAR(solution.lambda[1], -1, 1e-9) << to_string(solver);
  }
  // Numbers near the ends of the range.
  for (const double size : {1e-250, 1e250}) {
    const Environment<double> large = boxed(contact({1, 1, 1}, {-2 * size, 3 * size, -0.5 * size}, 0.5));
    const Solution<double> solution = solve_one(large, SolverKind::npgs, Law::convex, 1e-10);
    EXPECT_NEAR(solution.lambda[0] / size, 2, 1e-9) << size;
    EXPECT_NEAR(solution.lambda[1] / size, -1, 1e-9) << size;
    EXPECT_NEAR(solution.lambda[2] / size, 0.5, 1e-9) << size;
  }
}

TEST(BoxFriction, MadeOfABatchOfFrictionConesItHasTheSameNumbers) {
  const ContactBatch<double> plain = ragged_batch(1, 3);
  const ContactBatch<double> made = with_box_friction(plain);
  EXPECT_EQ(made.arrays().A, plain.arrays().A);
  EXPECT_EQ(made.arrays().mu, plain.arrays().mu);
  std::size_t changed = 0;
  for (std::size_t c = 0; c < made.arrays().cone_kind.size(); ++c) {
    const ConeKind was = plain.arrays().cone_kind[c], is = made.arrays().cone_kind[c];
    EXPECT_EQ(is, was == ConeKind::friction ? ConeKind::box_friction : was);
    changed += is != was ? 1U : 0U;
  }
  EXPECT_GT(changed, 10U);
  EXPECT_EQ(made.law(), plain.law());
}

}  // namespace
