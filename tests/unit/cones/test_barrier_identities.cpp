#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "core/algorithm/solver/ipm/ipm.hpp"
#include "tests/support/oracles/oracle.hpp"
#include "tests/support/systems/prepared.hpp"
#include "tests/support/systems/random_lcp.hpp"

// Formulas of the textbook chapter about interior points, where their printed form is wrong or incomplete (README.md
// beside this file). Here: (g) Newton's step, (l) the barrier of the second-order cone.

namespace {

using namespace stiction;
using namespace stiction::test;
using oracle::Number;

/// Form of a step's linear system.
enum class Step {
  right,           ///< [A -I; W L][dx; dw] = [w - A x - b; tau - w x]
  feasible_start,  ///< the same with a first right-hand side of zero
  printed,         ///< [A -I; L W] with that zero
};

/// The step (dx, dw) from x, w > 0 to products tau, by elimination with pivots in extended precision; empty if
/// singular.
std::vector<Number> newton_step(const Lcp& lcp, Step kind, const std::vector<double>& x, const std::vector<double>& w,
                                double tau) {
  const std::size_t n = lcp.n();
  std::vector<Number> matrix(4 * n * n, 0), right(2 * n, 0);
  const std::vector<double> motion = lcp.motion(x);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < n; ++j) matrix[i * 2 * n + j] = static_cast<Number>(lcp.A[i * n + j]);
    matrix[i * 2 * n + n + i] = -1;
    matrix[(n + i) * 2 * n + i] = static_cast<Number>(kind == Step::printed ? x[i] : w[i]);
    matrix[(n + i) * 2 * n + n + i] = static_cast<Number>(kind == Step::printed ? w[i] : x[i]);
    if (kind == Step::right) right[i] = static_cast<Number>(w[i] - motion[i]);
    right[n + i] = static_cast<Number>(tau - w[i] * x[i]);
  }
  return oracle::detail::solve_linear(matrix, right).value_or(std::vector<Number>{});
}

/// Returns true if damped steps from x = w = 1 come to the solution: max |min(x, A x + b)| <= 1e-8 within 100.
bool is_solved_by(const Lcp& lcp, Step kind) {
  const std::size_t n = lcp.n();
  std::vector<double> x(n, 1.0), w(n, 1.0);
  for (int iteration = 0; iteration < 100 && !(lcp.error(x) <= 1e-8); ++iteration) {
    double gap = 0, length = 1;
    for (std::size_t i = 0; i < n; ++i) gap += x[i] * w[i];
    const auto step = newton_step(lcp, kind, x, w, 0.1 * gap / static_cast<double>(n));
    if (step.empty()) return false;
    for (std::size_t i = 0; i < n; ++i) {
      const auto dx = static_cast<double>(step[i]), dw = static_cast<double>(step[n + i]);
      if (dx < 0) length = std::min(length, -0.995 * x[i] / dx);
      if (dw < 0) length = std::min(length, -0.995 * w[i] / dw);
    }
    for (std::size_t i = 0; i < n; ++i) {
      x[i] += length * static_cast<double>(step[i]);
      w[i] += length * static_cast<double>(step[n + i]);
    }
  }
  return lcp.error(x) <= 1e-8;
}

// (g) The second block row is [W Lambda] for (dlambda, dw), the first right-hand side w - A lambda - b. Printed:
// [Lambda W] and zero, which is right where w = A lambda + b already.
TEST(ChapterBarriers, InteriorPointsBeginAnywhereWithTheRightStepAndNowhereWithThePrintedOne) {
  scenes::Rng rng(7);
  int right = 0, feasible_start = 0, printed = 0, iterations = 0;
  constexpr int kTrials = 60;
  for (int trial = 0; trial < kTrials; ++trial) {
    const Lcp lcp = random_lcp(rng, 6, 6, 0.1);
    right += is_solved_by(lcp, Step::right);
    feasible_start += is_solved_by(lcp, Step::feasible_start);
    printed += is_solved_by(lcp, Step::printed);
  }
  EXPECT_EQ(right, kTrials);
  EXPECT_EQ(feasible_start, 0);
  EXPECT_EQ(printed, 0);
  for (int trial = 0; trial < 200; ++trial) {
    const Lcp lcp = random_lcp(rng, 20, 20, 0.1);
    const auto solution = solve(batch_of({lcp.env()}), options(SolverKind::ipm, 1e-9, 50));
    EXPECT_EQ(solution.status[0].code, EnvCode::solved) << trial;
    EXPECT_LE(lcp.error(solution.lambda), 1e-7) << trial;
    iterations += solution.status[0].iterations;
  }
  EXPECT_LT(iterations, 14 * 200) << "plain steps took 14 each elsewhere; predictor and corrector, fewer";
}

// (g) Eliminated: (A + Lambda^-1 W) dlambda = -A lambda - b + tau Lambda^-1 e. The library's predictor, tau = 0, from
// its own first point.
TEST(ChapterBarriers, TheEliminatedStepOfTheLibraryIsTheStepOfTheWholeSystem) {
  scenes::Rng rng(8);
  for (int trial = 0; trial < 50; ++trial) {
    Prepared<Ipm, Law::convex, Dense> prepared(random_lcp(rng, 6, 6, 0.1).env());
    auto& s = prepared.system();
    const IpmSpace p(s);
    ASSERT_EQ(start_interior(prepared.team, s, p), 6);
    // In the solver's units, which differ from the caller's by powers of two.
    Lcp lcp{std::vector<double>(p.A.data, p.A.data + 36), std::vector<double>(6)};
    for (Index i = 0; i < 6; ++i) lcp.b[static_cast<std::size_t>(i)] = s.b[i];
    const std::vector<double> x(p.x, p.x + 6), w(p.z, p.z + 6);
    const std::vector<double> motion = lcp.motion(x);
    double infeasible = 0;
    for (std::size_t i = 0; i < 6; ++i) {
      p.motion[i] = motion[i];
      infeasible = std::max(infeasible, std::abs(w[i] - motion[i]));
    }
    EXPECT_GT(infeasible, 1e-3) << "a feasible start would not tell the two apart";
    scale_cones(prepared.team, s, p);
    factor_step(prepared.team, s, p);
    predict(prepared.team, s, p, complementarity(prepared.team, s, p));
    const auto right = newton_step(lcp, Step::right, x, w, 0), printed = newton_step(lcp, Step::printed, x, w, 0);
    double size = 0, error = 0, other = 0;
    for (std::size_t i = 0; i < 6; ++i) {
      size = std::max(size, std::abs(static_cast<double>(right[i])));
      error = std::max(error, std::abs(p.step[i] - static_cast<double>(right[i])));
      other = std::max(other, std::abs(p.step[i] - static_cast<double>(printed.at(i))));
    }
    EXPECT_LE(error, 1e-10 * size) << trial;
    EXPECT_GT(other, 1e-3 * size) << trial;
  }
}

using Point = std::array<double, 3>;

/// -1/2 log(x_0^2 - |x_t|^2), of degree 1; the chapter's, without the half, is of degree 2.
Number half_barrier(const Point& x, const std::array<Number, 3>& shift) {
  const auto square = [&](std::size_t k) { return std::pow(static_cast<Number>(x[k]) + shift[k], 2); };
  const Number d = square(0) - square(1) - square(2);
  return -std::log(d) / 2;
}

/// Its derivative along u by central differences.
Number slope(const Point& x, const Point& u) {
  constexpr Number kStep = 1e-6L;
  std::array<Number, 3> ahead{}, behind{};
  for (std::size_t k = 0; k < 3; ++k) {
    ahead[k] = kStep * static_cast<Number>(u[k]);
    behind[k] = -kStep * static_cast<Number>(u[k]);
  }
  return (half_barrier(x, ahead) - half_barrier(x, behind)) / (2 * kStep);
}

/// Its second derivative along u and v by differences.
Number curvature(const Point& x, const Point& u, const Point& v) {
  constexpr Number kStep = 1e-5L;
  const auto at = [&](int a, int b) {
    std::array<Number, 3> shift{};
    for (std::size_t k = 0; k < 3; ++k) shift[k] = kStep * static_cast<Number>(a * u[k] + b * v[k]);
    return half_barrier(x, shift);
  };
  return (at(1, 1) - at(1, -1) - at(-1, 1) + at(-1, -1)) / (4 * kStep * kStep);
}

// (l) phi = -log(x_0^2 - |x_t|^2) with x_0 > 0, degree 2: grad = -2 J x / d. Interior points here use half of it,
// degree 1, so that the gap of a cone is x'z itself. The first point's z is minus that gradient times the gap.
TEST(ChapterBarriers, TheFirstDualOfAConeIsTheGradientOfHalfTheBarrier) {
  Environment<double> env = system({friction(3)}, diagonal({2, 1, 1}), {-1, 0.3, -0.2});
  env.mu = {0, 1, 1};
  Prepared<Ipm, Law::convex, Dense> prepared(env);
  auto& s = prepared.system();
  const IpmSpace p(s);
  ASSERT_EQ(start_interior(prepared.team, s, p), 1) << "one barrier term for a cone";
  const Point x{p.x[0], p.x[1], p.x[2]}, z{p.z[0], p.z[1], p.z[2]};
  EXPECT_GT(x[0], std::hypot(x[1], x[2])) << "inside, x_0 > 0";
  double gap = 0;
  for (Index k = 0; k < 3; ++k) gap += s.b[k] * s.b[k] / (p.A(k, k) + (p.A(0, 0) + p.A(1, 1) + p.A(2, 2)) / 3);
  for (std::size_t k = 0; k < 3; ++k) {
    Point axis{};
    axis[k] = 1;
    EXPECT_NEAR(z[k], -gap * static_cast<double>(slope(x, axis)), 1e-9) << k;
  }
  EXPECT_NEAR(static_cast<double>(slope(x, x)), -1, 1e-9) << "degree 1; of the whole logarithm 2";
  scale_cones(prepared.team, s, p);
  EXPECT_NEAR(complementarity(prepared.team, s, p), gap, 1e-12 * gap);
}

// (l) hess = -2 J / d + 4 (J x)(J x)' / d^2, half of it here. W^-2 of a pair x, z = -grad is the Hessian at x.
TEST(ChapterBarriers, TheScalingOfACentralPairIsTheHessianOfHalfTheBarrier) {
  scenes::Rng rng(9);
  for (int trial = 0; trial < 50; ++trial) {
    const double t1 = rng.symmetric(1.0), t2 = rng.symmetric(1.0);
    const Point x{std::hypot(t1, t2) + rng.uniform(0.3, 1.0), t1, t2};
    const double d = x[0] * x[0] - t1 * t1 - t2 * t2;
    const ConeScaling<3> scaling = scale_cone<3>({x[0], x[1], x[2]}, {x[0] / d, -x[1] / d, -x[2] / d});
    std::array<Point, 3> frame{};
    for (std::size_t k = 0; k < 3; ++k) {
      double v[3] = {};
      v[k] = 1;
      scaling.from_frame(v);
      frame[k] = {v[0], v[1], v[2]};
    }
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j) {
        const double expected = i == j ? scaling.diagonal(static_cast<int>(i)) : 0.0;
        const auto found = static_cast<double>(curvature(x, frame[i], frame[j]));
        EXPECT_NEAR(found, expected, 1e-6 * scaling.diagonal(0) + 1e-6 * scaling.diagonal(1)) << trial << i << j;
      }
  }
}

// (l) x_0 > 0 is required: the logarithm is the same at -x. A step ends at the cone's tip, not where d is positive
// again.
TEST(ChapterBarriers, AStepDoesNotPassThroughTheTipIntoTheOtherHalf) {
  const double x[] = {1, 0.2, -0.1};
  const double through[] = {-2, -0.4, 0.2};
  const Point here{1, 0.2, -0.1}, there{-1, -0.2, 0.1};
  EXPECT_EQ(half_barrier(here, {}), half_barrier(there, {})) << "which that step would reach";
  EXPECT_NEAR(1 / reciprocal_step<3>(x, through), 0.5, 1e-12);
}

}  // namespace
