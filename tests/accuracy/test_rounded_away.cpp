#include <gtest/gtest.h>

#include <span>

#include "scenes/body_scenes.hpp"
#include "stiction/residual.hpp"
#include "tests/support/systems/small_systems.hpp"

/// Problems without a solution, and coefficients without sense. A reaction or a friction so large that everything else
/// is rounding beside it has a residual of zero, and is not solved.
namespace stiction::test {
namespace {

constexpr double kTolerance = 1e-6;

struct Hopeless {
  std::string name;
  Environment<double> env;
};

std::vector<Hopeless> hopeless() {
  // Reaction and motion of every one of these contradict each other, whatever the reaction is.
  return {{"two free rows that differ", system({free_row(), free_row()}, {1, 1, 1, 1}, {1, -1})},
          {"nothing that could move a free row", system({free_row()}, {0}, {1})},
          {"a body between walls that meet", system({unilateral(), unilateral()}, {1, -1, -1, 1}, {-1, -1})}};
}

TEST(RoundedAway, NoSolverCallsAProblemWithoutASolutionSolved) {
  std::vector<SolverKind> solvers(std::begin(kEverySolver), std::end(kEverySolver));
  solvers.push_back(SolverKind::automatic);
  for (const auto& [name, env] : hopeless())
    for (const SolverKind solver : solvers)
      for (const Law law : kBothLaws) {
        const ContactBatch<double> batch = batch_of({env}, law);
        SolverOptions asked = options(solver, kTolerance, 2000);
        asked.invalid = InvalidPolicy::isolate;
        const auto in_double = solve(batch, asked).status[0];
        const auto in_single = solve(convert<float>(batch), asked).status[0];
        for (const EnvStatus& status : {in_double, in_single}) {
          EXPECT_NE(status.code, EnvCode::solved) << name << ", " << to_string(solver);
          EXPECT_FALSE(status.residual <= kTolerance) << name << ", " << to_string(solver);
        }
      }
}

TEST(RoundedAway, WhatHasASolutionIsSolvedAsFarAsDoublesReach) {
  for (const SolverKind solver : {SolverKind::npgs, SolverKind::admm, SolverKind::ipm, SolverKind::automatic}) {
    const auto batch = batch_of({system({free_row(), unilateral()}, {2, 1, 1, 3}, {1e3, -1})});
    const EnvStatus status = solve(batch, options(solver, 1e-12, 5000)).status[0];
    EXPECT_EQ(status.code, EnvCode::solved) << to_string(solver) << ": " << status.residual;
  }
}

/// Squares of numbers below 1e-162 are zero in double, and so was the residual.
TEST(RoundedAway, NumbersWhoseSquaresVanishAreNotCalledSolvedUnseen) {
  for (const double scale : {1e-100, 1e-155, 1e-200, 1e-264, 1e-300}) {
    const auto batch = batch_of({contact({4, 1, 1}, {-scale, 0.3 * scale, 0.1 * scale}, 0.5),
                                 system({unilateral(), unilateral()}, {2, 1, 1, 2}, {-scale, scale})});
    for (const SolverKind solver : kEverySolver)
      for (const double tolerance : {kTolerance, 0.0})
        for (const int iterations : {0, 1}) {
          SolverOptions asked = options(solver, tolerance, iterations);
          asked.invalid = InvalidPolicy::isolate;
          const Solution<double> answer = solve(batch, asked);
          const auto judged = verify(batch.view(), std::span<const double>(answer.lambda));
          for (std::size_t env = 0; env < judged.size(); ++env)
            EXPECT_TRUE(answer.status[env].code != EnvCode::solved || judged[env].relative <= 1.001 * tolerance)
                << to_string(solver) << ", " << scale << ", " << tolerance << ": " << judged[env].relative;
        }
  }
  const auto at_rest = batch_of({contact({1, 1, 1}, {0, 0, 0}, 0.5)});
  EXPECT_EQ(solve(at_rest, options(SolverKind::npgs, kTolerance, 1)).status[0].code, EnvCode::solved);
}

TEST(RoundedAway, FrictionBeyondAllSenseHidesNoContactThatPenetrates) {
  const auto batch = batch_of({contact({1, 1, 1}, {-1, 1, 0}, 1e100)}, Law::coulomb);
  for (const SolverKind solver : kAllSolvers) {
    const Solution<double> answer = solve(batch, options(solver, kTolerance, 50));
    // If it is called solved, the contact is pressed.
    EXPECT_TRUE(answer.status[0].code != EnvCode::solved || answer.lambda[0] > 0.9) << to_string(solver);
  }
}

TEST(RoundedAway, AnOpenContactMaySlideAsFastAsItLikes) {
  // The first contact is pressed, w = lambda - 1; its reaction moves the second one along, by 1e25 a unit, and not
  // inward.
  std::vector<double> A = diagonal(std::vector<double>(6, 1.0));
  A[4 * 6 + 0] = 1e25;
  Environment<double> env = system({friction(3), friction(3)}, A, {-1, 0, 0, 1, 0, 0});
  env.mu = {0, 0.5, 0.5, 0, 0.5, 0.5};
  SolverOptions asked = options(SolverKind::automatic, kTolerance, 200);
  const Solution<double> answer = solve(batch_of({env}, Law::coulomb), asked);
  EXPECT_EQ(answer.status[0].code, EnvCode::solved) << answer.status[0].residual;
  EXPECT_NEAR(answer.lambda[0], 1.0, 1e-6);
  EXPECT_EQ(answer.lambda[3], 0.0);
}

TEST(RoundedAway, NorDoesItInBodyForm) {
  BodyEnvironment<double> stack = scenes::make_body_stack(3, 4);
  for (auto& one : stack.contacts) one.mu = 1e100;
  BodyBatch<double> batch;
  batch.add(stack);
  for (const BodyMethod method : {BodyMethod::impulses, BodyMethod::newton}) {
    BodySolverOptions asked;
    asked.method = method;
    asked.tolerance = kTolerance;
    const auto solution = solve_bodies(batch, {}, asked);
    double pushed = 0;
    for (std::size_t row = 0; row < solution.impulse.size(); row += 3) pushed += solution.impulse[row];
    EXPECT_TRUE(solution.status[0].code != EnvCode::solved || pushed > 0) << to_string(method);
  }
}

}  // namespace
}  // namespace stiction::test
