#include <gtest/gtest.h>

#include <algorithm>
#include <span>
#include <vector>

#include "scenes/rng.hpp"
#include "stiction/residual.hpp"
#include "tests/support/machines/solve_alone.hpp"
#include "tests/support/systems/small_systems.hpp"

namespace stiction::test {
namespace {

/// Two players with costs A and B of every pair of choices, all positive. w = (A y, B' x) - 1 (Cottle, Pang, Stone
/// 1992, section 1.2). From x = y = 0 each choice lifts only the other player's rows, so that whatever enters first is
/// never blocked.
struct Game {
  int rows, columns;
  std::vector<double> A, B;  ///< by rows
};

Environment<double> problem_of(const Game& game) {
  const auto m = static_cast<std::size_t>(game.rows);
  const auto k = static_cast<std::size_t>(game.columns);
  const std::size_t n = m + k;
  std::vector<double> M(n * n, 0.0);
  for (std::size_t i = 0; i < m; ++i)
    for (std::size_t j = 0; j < k; ++j) {
      M[i * n + m + j] = game.A[i * k + j];
      M[(m + j) * n + i] = game.B[i * k + j];
    }
  return system(std::vector<Cone>(n, unilateral()), M, std::vector<double>(n, -1.0));
}

Solution<double> play(const Game& game) {
  return solve_alone(batch_of({problem_of(game)}), options(SolverKind::lemke, 1e-10, 4096));
}

/// Plays the mixed choices lambda against the costs themselves: played ones must cost 1, and nothing may cost less.
/// Returns the largest error.
double regret(const Game& game, const std::vector<double>& lambda) {
  double worst = 0.0;
  double total = 0.0;
  const auto look_at = [&](double played, double cost) {
    worst = std::max({worst, -played, 1.0 - cost, played > 0.0 ? cost - 1.0 : 0.0});
    total += played;
  };
  for (int i = 0; i < game.rows; ++i) {
    double cost = 0.0;
    for (int j = 0; j < game.columns; ++j)
      cost += game.A[static_cast<std::size_t>(i * game.columns + j)] * lambda[static_cast<std::size_t>(game.rows + j)];
    look_at(lambda[static_cast<std::size_t>(i)], cost);
  }
  for (int j = 0; j < game.columns; ++j) {
    double cost = 0.0;
    for (int i = 0; i < game.rows; ++i)
      cost += game.B[static_cast<std::size_t>(i * game.columns + j)] * lambda[static_cast<std::size_t>(i)];
    look_at(lambda[static_cast<std::size_t>(game.rows + j)], cost);
  }
  return total > 0.0 ? worst : 1.0;
}

TEST(LemkeGames, AGameOfTheHandbookHasOneOfItsThreeEquilibria) {
  // C. A. Floudas et al., Handbook of Test Problems in Local and Global Optimization (1999), 10.2.4: both players' pure
  // choices, or the mixture of both. Worked out by hand: 10 / 10, 15 / 15, and 10 p + 20 q = 30 p + 15 q = 1.
  const Solution<double> solution = play({2, 2, {10, 20, 30, 15}, {10, 30, 20, 15}});
  EXPECT_EQ(solution.status[0].code, EnvCode::solved);
  const std::vector<std::vector<double>> equilibria = {
      {0.1, 0, 0.1, 0}, {0, 1.0 / 15, 0, 1.0 / 15}, {1.0 / 90, 4.0 / 90, 1.0 / 90, 4.0 / 90}};
  EXPECT_TRUE(std::any_of(equilibria.begin(), equilibria.end(), [&](const std::vector<double>& one) {
    double apart = 0.0;
    for (std::size_t i = 0; i < 4; ++i) apart = std::max(apart, std::abs(one[i] - solution.lambda[i]));
    return apart < 1e-15;
  }));
}

TEST(LemkeGames, MatchingPenniesIsMixed) {
  const Solution<double> solution = play({2, 2, {1, 3, 3, 1}, {3, 1, 1, 3}});
  EXPECT_EQ(solution.status[0].code, EnvCode::solved);
  for (const double lambda : solution.lambda) EXPECT_NEAR(lambda, 0.25, 1e-15);
}

TEST(LemkeGames, EveryGameHasAnEquilibriumAndItIsFound) {
  scenes::Rng rng(19640612);
  for (int trial = 0; trial < 200; ++trial) {
    Game game{1 + rng.below(9), 1 + rng.below(9), {}, {}};
    const bool has_ties = trial % 2 == 1;  // whole costs from 1 to 3: degenerate
    for (auto* costs : {&game.A, &game.B})
      for (int i = 0; i < game.rows * game.columns; ++i)
        costs->push_back(has_ties ? 1.0 + rng.below(3) : rng.uniform(0.1, 1.0));
    const Solution<double> solution = play(game);
    EXPECT_EQ(solution.status[0].code, EnvCode::solved) << "trial " << trial;
    EXPECT_LE(regret(game, solution.lambda), 1e-11) << "trial " << trial;
  }
}

// Each row is moved by the other's reaction alone, and counts in the unit of its largest entry. w = (0, 4) beside a
// reaction of 1.
TEST(LemkeGames, AnAnswerIsJudgedWithoutADiagonal) {
  const ContactBatch<double> batch = batch_of({problem_of({1, 1, {2}, {2}})});
  const std::vector<double> right{0.5, 0.5}, wrong{2.5, 0.5};
  EXPECT_EQ(verify(batch.view(), std::span<const double>(right))[0].relative, 0.0);
  EXPECT_EQ(verify(batch.view(), std::span<const double>(wrong))[0].absolute, 1.0);
}

TEST(LemkeGames, WhatHasNoSolutionStillEndsOnARay) {
  // w = -1 - lambda; and w_0 = -1e-4 - lambda_1 - lambda_2 (a perturbation of an example of Pang's).
  const auto alone = system({unilateral()}, {-1}, {-1});
  const auto three = system({unilateral(), unilateral(), unilateral()}, {0, -1, -1, 1, 0, 0, -1, 0, 0}, {-1e-4, -1, 1});
  for (const auto& env : {alone, three}) {
    const Solution<double> solution = solve_alone(batch_of({env}), options(SolverKind::lemke, 1e-10, 4096));
    EXPECT_EQ(solution.status[0].code, EnvCode::stalled);
    EXPECT_EQ(solution.status[0].flags & kFlagRay, kFlagRay);
    EXPECT_LE(solution.status[0].iterations, 40);
  }
}

}  // namespace
}  // namespace stiction::test
