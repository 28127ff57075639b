#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "bench/scenes/rng.hpp"
#include "core/body/cones.hpp"
#include "tests/support/small_systems.hpp"

// Formulas of the textbook chapter the project grew from, where its printed form is wrong: what the form says, and what
// is true. Letters are those of the audit.

namespace {

using namespace stiction;
using namespace stiction::test;

// (a) The chapter's step subtracts the whole product, diagonal included, and does not start from lambda_i.
TEST(ChapterFormulas, TheProjectedGaussSeidelStepNeedsItsOwnReactionOrNotItsOwnDiagonal) {
  constexpr double kA = 2, kB = -4;  // lambda = 2
  double chapter = 0, from_residual = 0, without_diagonal = 0;
  std::vector<double> seen;
  for (int sweep = 0; sweep < 4; ++sweep) {
    // Printed: lambda + max(0, -(b + A lambda without diagonal) / A), that is both forms at once.
    chapter = std::max(0.0, chapter - kB / kA);
    from_residual = std::max(0.0, from_residual - (kB + kA * from_residual) / kA);
    without_diagonal = std::max(0.0, -kB / kA);
    seen.push_back(chapter);
  }
  EXPECT_EQ(seen, (std::vector<double>{2, 4, 6, 8})) << "the mixed form walks away";
  EXPECT_EQ(from_residual, 2);
  EXPECT_EQ(without_diagonal, 2);
  EXPECT_EQ(solve(batch_of({system({unilateral()}, {kA}, {kB})}), options(SolverKind::pgs, 0, 4)).lambda[0], 2);
}

/// The chain 2 -1 0 .. with a right-hand side that keeps every contact closed.
Environment<double> chain(std::size_t n) {
  std::vector<double> A(n * n, 0.0), b(n, -1.0);
  for (std::size_t i = 0; i < n; ++i) {
    A[i * n + i] = 2;
    if (i > 0) A[i * n + i - 1] = A[(i - 1) * n + i] = -1;
  }
  return system(std::vector<Cone>(n, unilateral()), A, b);
}

/// Residuals of pgs after each of the given numbers of sweeps.
double residual_after(const Environment<double>& env, Index sweeps, double omega) {
  SolverOptions o = options(SolverKind::pgs, 0, sweeps);
  o.omega = omega;
  return solve(batch_of({env}), o).status[0].residual;
}

// (c), (d) The chapter gives PGS the rate of the gradient method, 1 - 2 / (kappa + 1), and omega without saying which
// radius it wants. For this chain the Jacobi radius is cos(pi / (n + 1)); Gauss-Seidel's rate is its square, SOR's with
// omega = 2 / (1 + sqrt(1 - rho_J^2)) is omega - 1.
TEST(ChapterFormulas, TheRatesOfGaussSeidelAndOverRelaxationAreThoseOfTheJacobiRadius) {
  constexpr std::size_t kN = 20;
  const auto env = chain(kN);
  const double jacobi = std::cos(std::numbers::pi / (kN + 1));
  const double kappa = (1 + jacobi) / (1 - jacobi);
  const double gauss_seidel = jacobi * jacobi;
  const double measured = std::pow(residual_after(env, 640, 1) / residual_after(env, 320, 1), 1.0 / 320);
  EXPECT_NEAR(measured, gauss_seidel, 1e-5);
  EXPECT_GT(std::abs(measured - (1 - 2 / (kappa + 1))), 1e-3) << "the gradient method's rate is another";
  EXPECT_NEAR(1 - 2 / (kappa + 1), jacobi, 1e-12) << "it is the Jacobi radius itself";

  const double omega = 2 / (1 + std::sqrt(1 - jacobi * jacobi));
  const double wrong = 2 / (1 + std::sqrt(1 - gauss_seidel * gauss_seidel));
  const double right_rate = std::pow(residual_after(env, 80, omega) / residual_after(env, 40, omega), 1.0 / 40);
  // A Jordan block makes the optimum's residual k rho^k: over 40 to 80 sweeps a factor 2^(1/40).
  EXPECT_NEAR(right_rate, (omega - 1) * std::pow(2.0, 1.0 / 40), 2e-2);
  EXPECT_LT(residual_after(env, 80, omega), 1e-2 * residual_after(env, 80, wrong));
}

/// Euclidean projection onto norm(t) <= mu n, as it should be.
std::array<double, 3> onto_friction_cone(const std::array<double, 3>& x, double mu) {
  const double t = std::hypot(x[1], x[2]);
  if (t <= mu * x[0]) return x;
  if (mu * t <= -x[0]) return {0, 0, 0};
  const double n = (x[0] + mu * t) / (1 + mu * mu);
  return {n, mu * n * x[1] / t, mu * n * x[2] / t};
}

/// The same with the chapter's polar test, norm(t) <= -n, which knows no mu.
std::array<double, 3> chapters_projection(const std::array<double, 3>& x, double mu) {
  const double t = std::hypot(x[1], x[2]);
  if (t <= mu * x[0]) return x;
  if (t <= -x[0]) return {0, 0, 0};
  const double n = (x[0] + mu * t) / (1 + mu * mu);
  return {n, mu * n * x[1] / t, mu * n * x[2] / t};
}

/// x - p in the polar cone and orthogonal to p: what makes p the nearest point.
bool is_nearest(const std::array<double, 3>& x, const std::array<double, 3>& p, double mu) {
  const std::array<double, 3> q{x[0] - p[0], x[1] - p[1], x[2] - p[2]};
  const bool in_cone = std::hypot(p[1], p[2]) <= mu * p[0] + 1e-12;
  const bool in_polar = mu * std::hypot(q[1], q[2]) <= -q[0] + 1e-12;
  return in_cone && in_polar && std::abs(p[0] * q[0] + p[1] * q[1] + p[2] * q[2]) <= 1e-12;
}

// (e)
TEST(ChapterFormulas, ThePolarConeOfAFrictionConeDependsOnMu) {
  const std::array<double, 3> x{-1, 1.5, 0};
  EXPECT_EQ(onto_friction_cone(x, 0.5), (std::array<double, 3>{0, 0, 0}));
  EXPECT_NEAR(chapters_projection(x, 0.5)[0], -0.2, 1e-15) << "a negative normal reaction";
  scenes::Rng rng(3);
  int wrong = 0;
  for (int sample = 0; sample < 20000; ++sample) {
    const double mu = rng.uniform(0.1, 0.9);
    std::array<double, 3> z;
    for (double& entry : z) entry = rng.symmetric(2.0);
    ASSERT_TRUE(is_nearest(z, onto_friction_cone(z, mu), mu));
    wrong += !is_nearest(z, chapters_projection(z, mu), mu);
    ASSERT_TRUE(is_nearest(z, chapters_projection(z, 1.0), 1.0)) << "at mu = 1 the two agree";
  }
  EXPECT_GT(wrong, 2000);
}

// (f) Inscribed pyramids: share of the disk's area that is lost, and of the force in the worst direction.
TEST(ChapterFormulas, AnEightSidedPyramidLosesTenPercentOfTheDisk) {
  const auto area_lost = [](int k) { return 1 - k * std::sin(2 * std::numbers::pi / k) / (2 * std::numbers::pi); };
  EXPECT_NEAR(area_lost(4), 0.3634, 5e-5);
  EXPECT_NEAR(area_lost(8), 0.0997, 5e-5) << "not 9.0 %";
  EXPECT_NEAR(area_lost(16), 0.0255, 5e-5);
  EXPECT_NEAR(1 - std::cos(std::numbers::pi / 8), 0.0761, 5e-5);
  // Counted, not computed: points of the disk outside of the octagon.
  scenes::Rng rng(8);
  int disk = 0, lost = 0;
  for (int sample = 0; sample < 400000; ++sample) {
    const double x = rng.symmetric(1.0), y = rng.symmetric(1.0);
    if (x * x + y * y > 1) continue;
    ++disk;
    bool inside = true;
    for (int side = 0; side < 8; ++side) {
      const double angle = (2 * side + 1) * std::numbers::pi / 8;
      inside = inside && x * std::cos(angle) + y * std::sin(angle) <= std::cos(std::numbers::pi / 8);
    }
    lost += !inside;
  }
  // Standard deviation of the share: sqrt(0.09 / 314000) = 5e-4; four of them.
  EXPECT_NEAR(static_cast<double>(lost) / disk, area_lost(8), 2.2e-3);
}

// (h) A unit mass slides at 1 m/s over the ground, mu = 0.5, g dt = 0.0981. Reactions lie in the friction cone and
// motion in its dual, not the other way round; without de Saxce's term the block takes off.
TEST(ChapterFormulas, PairedWithTheDualConeASlidingBlockLiftsOffUnlessDeSaxcesTermIsAdded) {
  const auto block = contact({1, 1, 1}, {-0.0981, 1, 0}, 0.5);
  for (const SolverKind solver : kAllSolvers) {
    SCOPED_TRACE(to_string(solver));
    const auto convex = solve(batch_of({block}, Law::convex), options(solver, 1e-12, 20000));
    EXPECT_NEAR(convex.lambda[0], 0.478, 5e-4);
    EXPECT_NEAR(convex.w[0], 0.380, 5e-4);
    EXPECT_NEAR(convex.w[0], 0.5 * std::abs(convex.w[1]), 1e-9) << "it lifts off at mu norm(w_t)";
    const auto coulomb = solve(batch_of({block}, Law::coulomb), options(solver, 1e-12, 20000));
    EXPECT_NEAR(coulomb.lambda[0], 0.0981, 1e-9);
    EXPECT_NEAR(coulomb.lambda[1], -0.04905, 1e-9);
    EXPECT_NEAR(coulomb.w[0], 0, 1e-9);
  }
}

// (m) The projection in circular coordinates, carried back, is not the Euclidean one: it is the nearest point in the
// metric of the scaling. Both vanish exactly at solutions.
TEST(ChapterFormulas, TheScaledProjectionIsNotTheEuclideanOneAndBothKnowTheCone) {
  constexpr double kMu = 0.5;
  const auto scaled = [](const std::array<double, 3>& x) {
    double z[] = {x[0], x[1] / kMu, x[2] / kMu};
    project_second_order_cone<3>(z);
    return std::array<double, 3>{z[0], kMu * z[1], kMu * z[2]};
  };
  scenes::Rng rng(4);
  double largest = 0;
  for (int sample = 0; sample < 5000; ++sample) {
    std::array<double, 3> x;
    for (double& entry : x) entry = rng.symmetric(2.0);
    const auto a = scaled(x), e = onto_friction_cone(x, kMu);
    for (std::size_t k = 0; k < 3; ++k) {
      const double difference = std::abs(a[k] - e[k]);
      if (difference > largest) largest = difference;
    }
    EXPECT_LE(std::hypot(a[1], a[2]), kMu * a[0] + 1e-14);
    // A point of the cone is a fixed point of both.
    const auto again = scaled(e);
    for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(again[k], e[k], 1e-14);
  }
  EXPECT_GT(largest, 0.5) << "differences are of order one, not of rounding";
}

}  // namespace
