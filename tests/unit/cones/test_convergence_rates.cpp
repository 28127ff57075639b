#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

#include "stiction/analysis.hpp"
#include "tests/support/systems/random_lcp.hpp"

// Formulas of the textbook chapter about speed, where their printed form is wrong (README.md beside this file).
// Here: (c) and (d) rates, (i) the chain of 100 bodies, (n) the step of a block. Numbers of (c), (d) and (i) that are
// written as decimals were measured by a separate program. It sweeps in the order of the rows.

namespace {

using namespace stiction;
using namespace stiction::test;

constexpr std::size_t kBodies = 100;
constexpr double kWeight = 0.0981;  ///< g dt [m/s]

/// A column of unit masses, the lowest on the ground, after a step of free fall: A = tridiag(-1, 2, -1) with 1 first.
/// `in_order` stores the zeros too, which makes the path dense and sweeps go row by row; else colours go in turn.
Environment<double> column(bool in_order) {
  Environment<double> env;
  for (std::size_t i = 0; i < kBodies; ++i) {
    for (std::size_t j = 0; j < kBodies; ++j) {
      const double entry = i == j ? (i == 0 ? 1 : 2) : (i + 1 == j || j + 1 == i ? -1 : 0);
      if (!in_order && entry == 0) continue;
      env.column.push_back(static_cast<Index>(j));
      env.A.push_back(entry);
    }
    env.row_offsets.push_back(static_cast<Index>(env.column.size()));
    env.cones.push_back(unilateral());
    env.b.push_back(i == 0 ? -kWeight : 0);
  }
  return env;
}

/// max |lambda - lambda*| / max lambda*; contact i carries all that is above it.
double reaction_error(const std::vector<double>& lambda) {
  double largest = 0;
  for (std::size_t i = 0; i < kBodies; ++i) {
    const double exact = kWeight * static_cast<double>(kBodies - i);
    largest = std::max(largest, std::abs(lambda[i] - exact));
  }
  return largest / (kWeight * kBodies);
}

/// max |min(lambda, w)| / (g dt), w from the definition.
double natural_error(const std::vector<double>& lambda) {
  double largest = 0;
  for (std::size_t i = 0; i < kBodies; ++i) {
    double w = (i == 0 ? lambda[i] - kWeight : 2 * lambda[i] - lambda[i - 1]);
    if (i + 1 < kBodies) w -= lambda[i + 1];
    largest = std::max(largest, std::abs(std::min(lambda[i], w)));
  }
  return largest / kWeight;
}

Solution<double> swept(bool in_order, Index sweeps, double omega = 1, double tolerance = 0) {
  SolverOptions o = options(SolverKind::pgs, tolerance, sweeps);
  o.omega = omega;
  return solve(batch_of({column(in_order)}), o);
}

/// Factor by which a sweep reduces the residual, between `first` and twice as many sweeps.
double contraction(Index first, double omega) {
  return std::pow(swept(true, 2 * first, omega).status[0].residual / swept(true, first, omega).status[0].residual,
                  1.0 / first);
}

const double kJacobi = std::cos(std::numbers::pi / (2 * kBodies));  ///< rho(I - D^-1 A) of the column

// (d) The gradient method's rate is (kappa - 1) / (kappa + 1) = 1 - 2 / (kappa + 1). A consistently ordered A has
// rho_J^2 for Gauss-Seidel, nearly the square of that. Printed: the gradient method's rate for PGS.
TEST(ChapterRates, PgsHasTheSquareOfJacobisRadiusAndNotTheGradientMethodsRate) {
  AnalysisOptions steps;
  steps.max_steps = 2000;
  const double kappa = analyse(batch_of({column(false)}).view(), steps)[0].condition();
  const double exact = std::pow(std::tan(std::numbers::pi / (4 * kBodies + 2)), -2);
  EXPECT_NEAR(kappa, exact, 1e-3 * exact);
  EXPECT_NEAR(kappa, 16370, 20);
  const double printed = 1 - 2 / (kappa + 1);
  const double measured = contraction(10000, 1);
  EXPECT_NEAR(measured, kJacobi * kJacobi, 1e-8);
  EXPECT_NEAR(measured, 0.999753, 5e-7);
  EXPECT_NEAR(std::pow((kappa - 1) / (kappa + 1), 2), 0.999756, 5e-7) << "close to it";
  EXPECT_NEAR(printed, 0.999878, 5e-7);
  EXPECT_NEAR(std::log(measured) / std::log(printed), 2, 0.05) << "half as fast";
}

// (c) omega = 2 / (1 + sqrt(1 - rho^2)) with Jacobi's radius rho, rate omega - 1. Printed without saying which radius.
TEST(ChapterRates, TheBestRelaxationWantsJacobisRadius) {
  const auto omega_for = [](double radius) { return 2 / (1 + std::sqrt(1 - radius * radius)); };
  const double right = omega_for(kJacobi), wrong = omega_for(kJacobi * kJacobi);
  EXPECT_NEAR(right, 1.96907, 5e-6);
  EXPECT_NEAR(wrong, 1.9565, 5e-5);
  // At the best omega the largest eigenvalue is double: k sweeps leave k rho^k, a factor 2^(1/400) from 400 to 800.
  EXPECT_NEAR(contraction(400, right), 0.96907 * std::pow(2.0, 1.0 / 400), 2e-3);
  // Below it the eigenvalue mu^2 solves mu^2 - omega rho mu + omega - 1 = 0 (Young).
  const double half = 0.5 * wrong * kJacobi;
  const double slower = std::pow(half + std::sqrt(half * half - (wrong - 1)), 2);
  EXPECT_NEAR(slower, 0.987, 5e-4);
  EXPECT_NEAR(contraction(800, wrong), slower, 2e-4);
  EXPECT_NEAR(std::log(right - 1) / std::log(slower), 2.4, 0.05) << "times as many sweeps";
  const auto sweeps = [](double omega) { return swept(true, 20000, omega, 1e-6).status[0].iterations; };
  for (const double other : {1.5, 1.9, wrong, 1.98, 1.99}) EXPECT_GT(sweeps(other), sweeps(right)) << other;
  EXPECT_GT(sweeps(wrong), 1.7 * sweeps(right));
}

// (c) Any 0 < omega < 2 converges for a symmetric positive definite A.
TEST(ChapterRates, EveryRelaxationBelowTwoConverges) {
  scenes::Rng rng(5);
  for (int trial = 0; trial < 20; ++trial) {
    const Lcp lcp = random_lcp(rng, 6, 6, 0.2);
    for (const double omega : {0.05, 0.5, 1.5, 1.95}) {
      SolverOptions o = options(SolverKind::pgs, 1e-9, 20000);
      o.omega = omega;
      const auto solution = solve(batch_of({lcp.env()}), o);
      EXPECT_LE(lcp.error(solution.lambda), 1e-8) << "omega " << omega << ", trial " << trial;
    }
  }
}

// (i) Printed: about 200 sweeps to 1e-3. A separate program takes 27145 until the reactions are that close. It takes
// 12141 until the natural residual is 1e-3 g dt, in the order of the rows. With the best omega it takes 288.
TEST(ChapterRates, AChainOfAHundredBodiesTakesThousandsOfSweeps) {
  const auto printed = swept(true, 200);
  EXPECT_GT(reaction_error(printed.lambda), 0.5);
  EXPECT_GT(natural_error(printed.lambda), 0.03);
  for (const bool in_order : {true, false}) {
    EXPECT_GT(reaction_error(swept(in_order, 27144).lambda), 1e-3) << in_order;
    EXPECT_LE(reaction_error(swept(in_order, 27145).lambda), 1e-3) << in_order;
  }
  EXPECT_GT(natural_error(swept(true, 12140).lambda), 1e-3);
  EXPECT_LE(natural_error(swept(true, 12141).lambda), 1e-3);
  // By colours every second contact moves first, and residuals alternate more: 14950 in that program as well.
  EXPECT_GT(natural_error(swept(false, 14949).lambda), 1e-3);
  EXPECT_LE(natural_error(swept(false, 14950).lambda), 1e-3);
  const double omega = 2 / (1 + std::sqrt(1 - kJacobi * kJacobi));
  EXPECT_GT(reaction_error(swept(true, 287, omega).lambda), 1e-3);
  EXPECT_LE(reaction_error(swept(true, 288, omega).lambda), 1e-3);
}

/// Steps lambda <- P(lambda - r (A lambda + b)) onto the cone of mu = 1; true if they reach the answer that sticks.
bool scalar_step_converges(const std::vector<double>& A, const std::vector<double>& b,
                           const std::vector<double>& sticking, double r) {
  std::vector<double> x(3, 0.0);
  for (int step = 0; step < 2000; ++step) {
    std::vector<double> z = x;
    for (std::size_t i = 0; i < 3; ++i) {
      double y = b[i];
      for (std::size_t j = 0; j < 3; ++j) y += A[i * 3 + j] * x[j];
      z[i] -= r * y;
    }
    const double length = std::hypot(z[1], z[2]);
    if (length <= -z[0]) {
      x = {0, 0, 0};
    } else if (length <= z[0]) {
      x = z;
    } else {
      const double normal = 0.5 * (z[0] + length);
      x = {normal, normal * z[1] / length, normal * z[2] / length};
    }
  }
  double error = 0;
  for (std::size_t i = 0; i < 3; ++i) error = std::max(error, std::abs(x[i] - sticking[i]));
  return error <= 1e-6;
}

// (n) A block that moves by one step length r and a projection converges for r <= 1 / lambda_max(A_ii). The chapter
// updates blocks without naming r; its 1 / A_ii of rows is too long for a coupled block.
TEST(ChapterRates, ABlockMovesByTheLargestEigenvalueOfItsMatrixAndNotByItsDiagonal) {
  // Eigenvalues 1 + 2 c, 1 - c, 1 - c.
  constexpr double kCoupling = 0.9;
  const std::vector<double> A{1, kCoupling, kCoupling, kCoupling, 1, kCoupling, kCoupling, kCoupling, 1};
  const std::vector<double> sticking{1, 0.3, 0.2};
  std::vector<double> b(3, 0.0);
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j) b[i] -= A[i * 3 + j] * sticking[j];
  EXPECT_TRUE(scalar_step_converges(A, b, sticking, 1 / (1 + 2 * kCoupling)));
  EXPECT_FALSE(scalar_step_converges(A, b, sticking, 1)) << "one over the diagonal";
  Environment<double> env = system({friction(3)}, A, b);
  env.mu = {0, 1, 1};
  for (const Law law : kBothLaws)
    for (const SolverKind solver : kAllSolvers) {
      const auto solution = solve(batch_of({env}, law), options(solver, 1e-10, 5000));
      EXPECT_EQ(solution.status[0].code, EnvCode::solved) << label(solver, law);
      for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(solution.lambda[i], sticking[i], 1e-7) << label(solver, law);
    }
}

}  // namespace
