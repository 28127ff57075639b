// Cones of semidefinite: answers by hand, answers that systems were made for, the judge, refusals, hostile
// numbers.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "stiction/derivative.hpp"
#include "stiction/error.hpp"
#include "stiction/pyramid.hpp"
#include "stiction/residual.hpp"
#include "tests/support/systems/boxed.hpp"
#include "tests/support/systems/derivative_cases.hpp"
#include "tests/support/systems/factor_systems.hpp"
#include "tests/support/systems/scene_batches.hpp"
#include "tests/support/systems/semidefinite_systems.hpp"
#include "tests/support/systems/small_systems.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

const double kRoot = std::sqrt(2.0);

/// Solvers that project, and those that refuse.
const SolverKind kTake[] = {SolverKind::jacobi, SolverKind::apgd, SolverKind::admm, SolverKind::automatic};
const SolverKind kRefuse[] = {SolverKind::pgs,   SolverKind::npgs, SolverKind::nsgs,    SolverKind::newton,
                              SolverKind::lemke, SolverKind::ipm,  SolverKind::subspace};

/// lambda minimises 1/2 |lambda - z|^2: the projection of z.
Environment<double> nearest_to(const std::vector<double>& z) {
  std::vector<double> b;
  for (const double value : z) b.push_back(-value);
  return system({semidefinite(static_cast<Index>(z.size()))}, diagonal(std::vector<double>(z.size(), 1.0)), b);
}

void expect_answer(const Environment<double>& env, const std::vector<double>& expected) {
  for (const SolverKind solver : kTake)
    for (const Law law : kBothLaws) {
      SCOPED_TRACE(label(solver, law));
      const Solution<double> solution = solve(batch_of({env}, law), options(solver, 1e-13, 20000));
      EXPECT_EQ(solution.status[0].code, EnvCode::solved);
      for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(solution.lambda[i], expected[i], 1e-12) << i;
      const Solution<float> narrow = solve(convert<float>(batch_of({env}, law)), options(solver, 1e-6, 20000));
      EXPECT_EQ(narrow.status[0].code, EnvCode::solved);
      for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(narrow.lambda[i], expected[i], 1e-5) << i;
    }
}

TEST(Semidefinite, OneMatrixByHand) {
  expect_answer(nearest_to({0, kRoot, 0}), {0.5, 0.5 * kRoot, 0.5});  // eigenvalues 1 and -1
  expect_answer(nearest_to({2, kRoot, 2}), {2, kRoot, 2});            // inside
  expect_answer(nearest_to({-2, kRoot, -2}), {0, 0, 0});              // nothing is left
  expect_answer(nearest_to({3, 0, -4}), {3, 0, 0});
  expect_answer(nearest_to({1, 0, -2, 0, 0, 3}), {1, 0, 0, 0, 0, 3});
  expect_answer(nearest_to({0, 0, 0, 0, kRoot, 0}), {0, 0, 0.5, 0, 0.5 * kRoot, 0.5});  // a_23
  Environment<double> heavy = nearest_to({0, kRoot, 0});
  heavy.R = {1, 1, 1};
  expect_answer(heavy, {0.25, 0.25 * kRoot, 0.25});
}

/// U diag(values) U' of order 2 or 3, laid out as a cone. U turns by three angles.
std::vector<double> matrix_of(const std::array<double, 3>& values, const std::array<double, 3>& angles, int order) {
  std::array<std::array<double, 3>, 3> U{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  const std::pair<std::size_t, std::size_t> planes[] = {{0, 1}, {0, 2}, {1, 2}};
  for (std::size_t p = 0; p < (order == 2 ? 1 : 3); ++p)
    for (auto& row : U) {
      const auto [i, j] = planes[p];
      const double left = row[i], right = row[j];
      row[i] = std::cos(angles[p]) * left - std::sin(angles[p]) * right;
      row[j] = std::sin(angles[p]) * left + std::cos(angles[p]) * right;
    }
  std::vector<double> rows;
  for (std::size_t j = 0; j < static_cast<std::size_t>(order); ++j)
    for (std::size_t i = 0; i <= j; ++i) {
      double sum = 0;
      for (std::size_t l = 0; l < static_cast<std::size_t>(order); ++l) sum += U[i][l] * values[l] * U[j][l];
      rows.push_back(i == j ? sum : kRoot * sum);
    }
  return rows;
}

struct Made {
  Environment<double> env;
  std::vector<double> lambda;
};

/// A random matrix, and b such that the answer is known. In each cone lambda and w share eigenvectors, each of which
/// belongs to one of them.
Made made_for_an_answer(std::uint64_t seed, int matrices, int contacts) {
  MatrixRecipe recipe;
  recipe.seed = seed;
  recipe.matrices = matrices;
  recipe.contacts = 0;
  recipe.others = contacts;
  Made made{random_with_matrices(recipe), {}};
  scenes::Rng rng(seed);
  std::vector<double> w;
  for (auto& cone : made.env.cones) {
    if (cone.kind != ConeKind::semidefinite) {
      cone.kind = ConeKind::unilateral;
      const bool holds = rng.chance(0.5);
      const double size = rng.uniform(0.1, 1);
      made.lambda.push_back(holds ? size : 0);
      w.push_back(holds ? 0 : size);
      continue;
    }
    std::array<double, 3> kept{}, left{}, angles{};
    for (std::size_t l = 0; l < 3; ++l) {
      angles[l] = rng.uniform(0, 6.2);
      const bool holds = rng.chance(0.5);
      (holds ? kept : left)[l] = rng.uniform(0.1, 1);
    }
    const int order = cone.row_count == 3 ? 2 : 3;
    for (const double value : matrix_of(kept, angles, order)) made.lambda.push_back(value);
    for (const double value : matrix_of(left, angles, order)) w.push_back(value);
  }
  const std::size_t n = w.size();
  for (std::size_t i = 0; i < n; ++i) {
    made.env.b[i] = w[i] - made.env.R[i] * made.lambda[i];
    for (std::size_t j = 0; j < n; ++j) made.env.b[i] -= made.env.A[i * n + j] * made.lambda[j];
  }
  return made;
}

// The matrix's smallest eigenvalue is 0.3, so lambda is off by at most four times the residual.
TEST(Semidefinite, AnswersThatSystemsWereMadeForAreFound) {
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    const Made made = made_for_an_answer(seed, 1 + static_cast<int>(seed % 5), static_cast<int>(seed % 4));
    const auto batch = batch_of({made.env}, seed % 2 == 0 ? Law::convex : Law::coulomb);
    for (const SolverKind solver : kTake) {
      SCOPED_TRACE(std::string(to_string(solver)) + ", seed " + std::to_string(seed));
      const Solution<double> solution = solve(batch, options(solver, 1e-11, 50000));
      EXPECT_EQ(solution.status[0].code, EnvCode::solved) << solution.status[0].residual;
      for (std::size_t i = 0; i < made.lambda.size(); ++i) EXPECT_NEAR(solution.lambda[i], made.lambda[i], 1e-9) << i;
      const Solution<float> narrow = solve(convert<float>(batch), options(solver, 1e-5, 50000));
      EXPECT_EQ(narrow.status[0].code, EnvCode::solved) << narrow.status[0].residual;
      for (std::size_t i = 0; i < made.lambda.size(); ++i) EXPECT_NEAR(narrow.lambda[i], made.lambda[i], 1e-3) << i;
    }
  }
}

TEST(Semidefinite, LargeEnvironmentsAreFoundToo) {
  const Made made = made_for_an_answer(3, 24, 6);
  ASSERT_GT(made.lambda.size(), 100U);
  for (const SolverKind solver : kTake) {
    const Solution<double> solution = solve(batch_of({made.env}), options(solver, 1e-10, 50000));
    EXPECT_EQ(solution.status[0].code, EnvCode::solved) << to_string(solver) << solution.status[0].residual;
    for (std::size_t i = 0; i < made.lambda.size(); ++i) EXPECT_NEAR(solution.lambda[i], made.lambda[i], 1e-8) << i;
  }
}

// The judge has an eigensolver of its own. Under Coulomb's law contacts stand beside matrices.
TEST(Semidefinite, BesideFrictionTheJudgeAgrees) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    MatrixRecipe recipe;
    recipe.seed = seed;
    const Environment<double> env = random_with_matrices(recipe);
    for (const SolverKind solver : kTake)
      for (const Law law : kBothLaws) {
        SCOPED_TRACE(label(solver, law) + ", seed " + std::to_string(seed));
        const auto batch = batch_of({env}, law);
        const Solution<double> solution = solve(batch, options(solver, 1e-10, 50000));
        EXPECT_EQ(solution.status[0].code, EnvCode::solved) << solution.status[0].residual;
        const Residual judged = verify(batch.view(), std::span<const double>(solution.lambda)).at(0);
        EXPECT_NEAR(judged.relative, solution.status[0].residual, 1e-13);
        EXPECT_LE(judged.relative, 1e-10);
      }
  }
}

TEST(Semidefinite, TheJudgeByHand) {
  const auto judged = [](const Environment<double>& env, const std::vector<double>& lambda) {
    return verify(batch_of({env}).view(), std::span<const double>(lambda)).at(0).absolute;
  };
  // a = 1, so the error is sqrt(2) norm(lambda - P(z)) whatever lambda is.
  const Environment<double> env = nearest_to({0, kRoot, 0});
  EXPECT_NEAR(judged(env, {0, 0, 0}), kRoot, 1e-15);
  EXPECT_NEAR(judged(env, {0.5, 0.5 * kRoot, 0.5}), 0.0, 1e-15);
  EXPECT_NEAR(judged(env, {0.5, -0.5 * kRoot, 0.5}), 2.0, 1e-15);
  const Environment<double> longer = nearest_to({0, 0, 2, 0, 0, -1});
  EXPECT_NEAR(judged(longer, {0, 0, 2, 0, 0, 0}), 0.0, 1e-15);
  EXPECT_NEAR(judged(longer, {3, 0, 2, 0, 4, 0}), 5.0 * kRoot, 1e-14);
  // Every residual that a solve reports is of answers that were judged so.
  for (const std::vector<double>& start : {std::vector<double>{1, 0, 1}, std::vector<double>{0, 0, 0.25}}) {
    const Solution<double> solution =
        solve(batch_of({env}), options(SolverKind::jacobi, 0, 0), Device::cpu(), std::span<const double>(start));
    EXPECT_NEAR(solution.status[0].residual_absolute, judged(env, solution.lambda), 1e-15);
  }
}

TEST(Semidefinite, AWarmStartIsProjectedAndAnAnswerIsKept) {
  const Environment<double> env = nearest_to({0, kRoot, 0, 0, 0, 1});
  const std::vector<double> warm = {1, 0, -2, 0, 0, 3};
  for (const SolverKind solver : {SolverKind::jacobi, SolverKind::apgd, SolverKind::admm}) {
    const Solution<double> solution =
        solve(batch_of({env}), options(solver, 0, 0), Device::cpu(), std::span<const double>(warm));
    EXPECT_EQ(solution.lambda, (std::vector<double>{1, 0, 0, 0, 0, 3})) << to_string(solver);
  }
  const Made made = made_for_an_answer(7, 4, 2);
  for (const SolverKind solver : kTake) {
    const auto batch = batch_of({made.env});
    const Solution<double> first = solve(batch, options(solver, 1e-9, 50000));
    const Solution<double> again =
        solve(batch, options(solver, 1e-8, 50000), Device::cpu(), std::span<const double>(first.lambda));
    EXPECT_EQ(again.status[0].iterations, 0) << to_string(solver);
  }
}

TEST(Semidefinite, SolversThatDoNotProjectRefuseItAndWriteNothing) {
  const ContactBatch<double> batch = batch_of({contact({1, 1, 1}, {-2, 0, 0}, 0.5), nearest_to({0, kRoot, 0})});
  for (const SolverKind solver : kRefuse) {
    Solution<double> solution{std::vector<double>(6, 7.0), std::vector<double>(6, 7.0), std::vector<EnvStatus>(2)};
    const Solver own(Device::cpu(), options(solver, 1e-8, 100));
    try {
      own.solve(batch.view(), {solution.lambda.data(), solution.w.data(), solution.status.data()});
      FAIL() << to_string(solver);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::unsupported);
      EXPECT_EQ(std::string(error.what()),
                "options.solver is " + std::string(to_string(solver)) +
                    ", but cone_kind[env 1, cone 0] is semidefinite, which only methods that project take: choose "
                    "jacobi, apgd, admm or auto");
    }
    EXPECT_EQ(solution.lambda, std::vector<double>(6, 7.0));
    EXPECT_EQ(solution.w, std::vector<double>(6, 7.0));
  }
}

// Kinds in a device's memory are out of the host's sight: the kernels flag them, of that environment alone.
TEST(Semidefinite, OnADeviceTheEnvironmentIsFlagged) {
  const ContactBatch<double> batch = batch_of({contact({1, 1, 1}, {-2, 0, 0}, 0.5), nearest_to({0, kRoot, 0})});
  ContactBatchView<double> there = batch.view();
  there.space = MemorySpace::cuda;
  const auto solved = [&](SolverKind solver, const Capacity& capacity) {
    Solution<double> solution{std::vector<double>(6, 7.0), std::vector<double>(6, 7.0), std::vector<EnvStatus>(2)};
    const Solver own(Device::emulated(), options(solver, 1e-8, 100), capacity);
    own.solve(there, {solution.lambda.data(), solution.w.data(), solution.status.data()});
    own.synchronize();
    EXPECT_EQ(solution.status[0].code, EnvCode::solved) << to_string(solver);
    return solution;
  };
  const Capacity enough = Capacity::of(batch.view());
  EXPECT_TRUE(enough.semidefinite);
  for (const SolverKind solver : {SolverKind::pgs, SolverKind::npgs, SolverKind::newton, SolverKind::ipm}) {
    const Solution<double> solution = solved(solver, enough);
    EXPECT_EQ(solution.status[1].code, EnvCode::unsupported);
    EXPECT_EQ(solution.status[1].flags, static_cast<std::uint32_t>(kFlagUnsupportedCone));
    EXPECT_EQ(solution.lambda[3], 0.0);
    EXPECT_EQ(solution.w[4], -kRoot) << "w = b";
  }
  Capacity without = enough;
  without.semidefinite = false;
  for (const SolverKind solver : kTake) {
    const Solution<double> solution = solved(solver, enough);
    EXPECT_EQ(solution.status[1].code, EnvCode::solved) << to_string(solver);
    EXPECT_NEAR(solution.lambda[3], 0.5, 1e-7);
    const Solution<double> refused = solved(solver, without);
    EXPECT_EQ(refused.status[1].flags, static_cast<std::uint32_t>(kFlagOverCapacity)) << to_string(solver);
  }
}

// Only jacobi of the methods that project takes boxed friction, too: that is where auto comes to.
TEST(Semidefinite, BesideBoxedFrictionJacobiAnswers) {
  MatrixRecipe recipe;
  recipe.seed = 5;
  recipe.shift = 1;
  const auto batch = batch_of({boxed(random_with_matrices(recipe))});
  for (const Device& device : {Device::cpu(), Device::emulated()})
    for (const SolverKind solver : {SolverKind::jacobi, SolverKind::automatic}) {
      const Solution<double> solution = solve(batch, options(solver, 1e-10, 50000), device);
      EXPECT_EQ(solution.status[0].code, EnvCode::solved) << solution.status[0].residual;
      EXPECT_EQ(solution.status[0].solver, SolverKind::jacobi);
      EXPECT_LE(verify(batch.view(), std::span<const double>(solution.lambda)).at(0).relative, 1e-10);
    }
  for (const SolverKind solver : {SolverKind::apgd, SolverKind::admm})
    EXPECT_EQ(solve(batch, options(solver, 1e-10, 100)).status[0].flags,
              static_cast<std::uint32_t>(kFlagUnsupportedCone))
        << to_string(solver);
}

TEST(Semidefinite, AutoSplitsAndFallsBackToGradients) {
  const Made made = made_for_an_answer(2, 5, 3);
  const Solution<double> solution = solve(batch_of({made.env}), options(SolverKind::automatic, 1e-9, 50000));
  EXPECT_EQ(solution.status[0].solver, SolverKind::admm);
  const Solution<double> all = solve(batch_of({made.env}), options(SolverKind::automatic, 0, 50000));
  EXPECT_EQ(all.status[0].solver, SolverKind::apgd) << "with tolerance 0 every stage is tried";
}

TEST(Semidefinite, IslandsApartHaveTheSameAnswers) {
  Environment<double> env = system({semidefinite(3), unilateral(), semidefinite(6)},
                                   diagonal({1, 1, 1, 2, 1, 1, 1, 1, 1, 1}), {0, -kRoot, 0, -1, -1, 0, 2, 0, 0, -3});
  SolverOptions apart = options(SolverKind::automatic, 1e-12, 1000);
  apart.islands = IslandMode::apart;
  const Solution<double> solution = solve(batch_of({env}), apart);
  EXPECT_EQ(solution.status[0].code, EnvCode::solved);
  const double expected[] = {0.5, 0.5 * kRoot, 0.5, 0.5, 1, 0, 0, 0, 0, 3};
  for (std::size_t i = 0; i < 10; ++i) EXPECT_NEAR(solution.lambda[i], expected[i], 1e-11) << i;
}

TEST(Semidefinite, PyramidsAndDerivativesRefuseIt) {
  const auto batch = batch_of({nearest_to({0, kRoot, 0})});
  try {
    linearise(batch, 4);
    FAIL() << "made a pyramid of a matrix";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::unsupported);
  }
  const Solution<double> solution = solve(batch, options(SolverKind::apgd, 1e-10, 1000));
  const auto gradients = vjp(batch.view(), solution.lambda, {1.0, 1.0, 1.0}, {}, DerivativeOptions{});
  EXPECT_EQ(gradients.status[0].flags & kGradientInvalidInput, static_cast<std::uint32_t>(kGradientInvalidInput));
  EXPECT_EQ(gradients.b, std::vector<double>(3, 0.0));
}

TEST(Semidefinite, RowsOfAMatrixHaveOneOrder) {
  const auto batch = batch_of({nearest_to({0, kRoot, 0})});
  ContactBatchView<double> view = batch.view();
  view.normal_last = true;
  const auto defects = validate(view);
  ASSERT_EQ(defects.size(), 1U);
  EXPECT_NE(defects[0].message.find("the normal last, but its rows have one order"), std::string::npos);
}

TEST(Semidefinite, FormsWithJacobiansAreAnsweredToo) {
  for (const SolverKind solver : kTake)
    for (const FactorUse use : {FactorUse::never, FactorUse::always}) {
      JacobianBatch<double> batch(Law::convex);
      std::vector<Environment<double>> matrices;
      for (std::uint64_t seed = 1; seed <= 3; ++seed) {
        JacobianRecipe recipe;
        recipe.seed = seed;
        recipe.dofs = 24;
        recipe.compliance = 0.2;
        JacobianEnvironment<double> env = random_jacobian(recipe);
        for (auto& cone : env.cones)
          if (is_cone(ConeKind::semidefinite, cone.row_count)) cone.kind = ConeKind::semidefinite;
        batch.add(env);
        matrices.push_back(as_matrix(env));
      }
      const ContactBatch<double> assembled = batch_of(matrices);
      const auto& kinds = assembled.arrays().cone_kind;
      ASSERT_GT(std::count(kinds.begin(), kinds.end(), ConeKind::semidefinite), 0);
      SCOPED_TRACE(std::string(to_string(solver)) + (use == FactorUse::always ? ", factor" : ", A"));
      const SolverOptions own = options(solver, 1e-9, 50000);
      const auto found = solve(batch, own, Device::cpu(), {}, use);
      const auto judged = verify(assembled.view(), std::span<const double>(found.contact.lambda));
      for (std::size_t e = 0; e < judged.size(); ++e) {
        EXPECT_EQ(found.contact.status[e].code, EnvCode::solved) << e;
        EXPECT_NE(found.contact.status[e].solver, SolverKind::velocity_newton) << e;
        EXPECT_LE(judged[e].relative, 1e-8) << e;
      }
      EXPECT_EQ(solve(batch, own, Device::emulated(), {}, use).contact.lambda, found.contact.lambda);
    }
}

TEST(Semidefinite, HostileNumbersAreFlaggedWhereTheyAreOrAnswered) {
  const Environment<double> sound = nearest_to({0, kRoot, 0});
  for (const double broken : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()})
    for (const SolverKind solver : kTake) {
      Environment<double> env = sound;
      env.b[1] = broken;
      SolverOptions isolating = options(solver, 1e-9, 1000);
      isolating.invalid = InvalidPolicy::isolate;
      const Solution<double> solution = solve(batch_of({sound, env, sound}), isolating);
      EXPECT_EQ(solution.status[0].code, EnvCode::solved);
      EXPECT_EQ(solution.status[2].code, EnvCode::solved);
      EXPECT_EQ(solution.status[1].flags, static_cast<std::uint32_t>(kFlagNonFiniteInput));
      for (std::size_t i = 3; i < 6; ++i) EXPECT_TRUE(std::isfinite(solution.lambda[i]));
      env = sound;
      const std::vector<double> guess = {broken, 1, 1};
      const Solution<double> warm =
          solve(batch_of({env}), options(solver, 1e-9, 1000), Device::cpu(), std::span<const double>(guess));
      EXPECT_EQ(warm.status[0].code, EnvCode::solved);
      EXPECT_EQ(warm.status[0].flags, static_cast<std::uint32_t>(kFlagWarmStartRejected));
    }
  for (const double size : {1e-250, 1e250})
    for (const SolverKind solver : kTake) {
      const Solution<double> solution =
          solve(batch_of({nearest_to({0, kRoot * size, 0})}), options(solver, 1e-10, 9999));
      EXPECT_NEAR(solution.lambda[0] / size, 0.5, 1e-9) << size << to_string(solver);
      EXPECT_NEAR(solution.lambda[1] / size, 0.5 * kRoot, 1e-9) << size << to_string(solver);
    }
  // Nothing pushes: zero, at once.
  const Solution<double> still = solve(batch_of({nearest_to({0, 0, 0})}), options(SolverKind::jacobi, 1e-12, 10));
  EXPECT_EQ(still.status[0].code, EnvCode::solved);
  EXPECT_EQ(still.lambda, std::vector<double>(3, 0.0));
}

}  // namespace
