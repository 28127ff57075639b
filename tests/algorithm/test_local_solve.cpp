#include "core/algorithm/solver/pgs.hpp"
#include "core/algorithm/sweep/local_solve.hpp"
#include "core/algorithm/sweep/uneven_friction.hpp"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "tests/support/oracles/oracle.hpp"
#include "tests/support/systems/prepared.hpp"
#include "tests/support/systems/random_systems.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

/// The step of the only cone of an environment from lambda = 0, in the solver's coordinates.
template <Law kLaw, ConeKind kKind, int M>
ConeStep<double, M> first_step(Prepared<Pgs, kLaw, Dense>& p, double omega = 1) {
  auto& s = p.system();
  double y[M];
  for (int k = 0; k < M; ++k) y[k] = s.y[k];
  return local_step<kLaw>(ConeShape<kKind, M>{}, s, 0, 0, y, omega);
}

TEST(LocalSolve, AFreeRowStepsToItsRoot) {
  // A = 2 is scaled to 1, b = -3 to -1.5: the root is 1.5.
  Prepared<Pgs, Law::convex, Dense> p(system({free_row()}, {2}, {-3}));
  EXPECT_EQ((first_step<Law::convex, ConeKind::free, 1>(p).d[0]), 1.5);
  EXPECT_EQ((first_step<Law::convex, ConeKind::free, 1>(p, 0.5).d[0]), 0.75);
}

TEST(LocalSolve, AUnilateralRowStopsAtZero) {
  Prepared<Pgs, Law::convex, Dense> pressed(system({unilateral()}, {2}, {-3}));
  EXPECT_EQ((first_step<Law::convex, ConeKind::unilateral, 1>(pressed).d[0]), 1.5);
  Prepared<Pgs, Law::convex, Dense> leaving(system({unilateral()}, {2}, {3}));
  EXPECT_EQ((first_step<Law::convex, ConeKind::unilateral, 1>(leaving).d[0]), 0.0);
}

TEST(LocalSolve, ABoxRowStopsAtItsBounds) {
  auto env = system({box()}, {1}, {-1});
  env.lo = {-0.25};
  env.hi = {0.5};
  Prepared<Pgs, Law::convex, Dense> up(env);
  EXPECT_EQ((first_step<Law::convex, ConeKind::box, 1>(up).d[0]), 0.5);
  env.b = {1};
  Prepared<Pgs, Law::convex, Dense> down(env);
  EXPECT_EQ((first_step<Law::convex, ConeKind::box, 1>(down).d[0]), -0.25);
}

TEST(LocalSolve, BoxedFrictionStepsRowByRowBetweenBoundsOfTheFreshNormal) {
  // mu = 1, so rows are not rescaled. x_n = 1 leaves the motions (-1/2 + 0.1, -0.5). The first row steps to 0.4,
  // inside, and leaves the second -0.5 + 0.4 / 2 = -0.3. With b_2 = -3 that is -2.8, and the row stops at its bound. b
  // is scaled by 1/2 then, and so is x.
  auto env = system({{ConeKind::box_friction, 3, -1}}, {1, -0.5, 0, -0.5, 1, 0.5, 0, 0.5, 1}, {-1, 0.1, -0.5});
  env.mu = {0, 1, 1};
  const auto step_of = [&] {
    Prepared<Pgs, Law::convex, Dense> p(env);
    return first_step<Law::convex, ConeKind::friction, 3>(p);
  };
  const auto inside = step_of();
  EXPECT_EQ(inside.d[0], 1.0);
  EXPECT_NEAR(inside.d[1], 0.4, 1e-15);
  EXPECT_NEAR(inside.d[2], 0.3, 1e-15);
  env.b[2] = -3;
  EXPECT_EQ(step_of().d[2], 0.5);
  env.b = {1, 0.1, -3};
  const auto open = step_of();
  for (const double d : open.d) EXPECT_EQ(d, 0.0);
}

TEST(LocalSolve, CoulombsStepSolvesTheNormalAloneAndCorrectsTheTangentForIt) {
  // Normal 1, coupling -1/2 to the first tangent: x_n = 1 moves the tangent's motion from 0 to -1/2 * mu, and the
  // tangent answers towards +. Team [1 -.5; -.5 1] with mu = 1, so rows are not rescaled.
  auto env = system({friction(2)}, {1, -0.5, -0.5, 1}, {-1, 0});
  env.mu = {0, 1};
  Prepared<Pgs, Law::coulomb, Dense> p(env);
  const auto step = first_step<Law::coulomb, ConeKind::friction, 2>(p);
  EXPECT_EQ(step.d[0], 1.0);
  EXPECT_NEAR(step.d[1], 0.5, 1e-14);
}

TEST(LocalSolve, CoulombsFrictionStaysOnTheDiskOfTheFreshNormal) {
  Prepared<Pgs, Law::coulomb, Dense> p(contact({1, 1, 1}, {-1, 30, -40}, 1.0));
  const auto step = first_step<Law::coulomb, ConeKind::friction, 3>(p);
  auto& s = p.system();
  const double normal = step.d[0];
  EXPECT_EQ(normal, -s.b[0]);
  EXPECT_NEAR(std::hypot(step.d[1], step.d[2]), normal, 1e-15);
  EXPECT_NEAR(step.d[1] / step.d[2], 30.0 / -40.0, 1e-14);
}

TEST(LocalSolve, AConvexStepNeverRaisesTheLocalObjective) {
  int moved = 0;
  for (std::uint64_t seed = 1; seed <= 300; ++seed) {
    const Environment<double> env = random_contacts(lone_contact(seed));
    if (env.cones[0].row_count != 4) continue;
    Prepared<Pgs, Law::convex, Dense> p(env);
    ASSERT_EQ(p.flags, 0U);
    const auto step = first_step<Law::convex, ConeKind::friction, 4>(p);
    auto& s = p.system();
    // q(d) = 1/2 d'Bd + y'd from d = 0.
    double objective = 0;
    for (int i = 0; i < 4; ++i) {
      objective += s.y[i] * step.d[i];
      for (int j = 0; j < 4; ++j) objective += 0.5 * step.d[i] * s.block_entry(0, i, j) * step.d[j];
    }
    EXPECT_LE(objective, 1e-15) << "seed " << seed;
    moved += objective < -1e-6;
  }
  EXPECT_GT(moved, 5);
}

TEST(LocalSolve, TheFixedPointOfEitherStepIsTheSolutionOfItsLaw) {
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    Recipe recipe = lone_contact(seed);
    recipe.mu_max = 0.3;
    const Environment<double> env = random_conditioned(recipe, 9.0);
    if (env.cones[0].row_count != 3) continue;
    SCOPED_TRACE("seed " + std::to_string(seed));
    const oracle::Answer convex = oracle::solve_convex(env);
    const oracle::Answer coulomb = oracle::solve_coulomb(env);
    ASSERT_TRUE(convex.converged && coulomb.converged);
    // Warm-started at the solution, the step goes nowhere: up to the condition number in scaled coordinates times the
    // rounding of the oracle's answer to double.
    Prepared<Pgs, Law::convex, Dense> a(env, convex.lambda);
    for (const double d : first_step<Law::convex, ConeKind::friction, 3>(a).d) EXPECT_NEAR(d, 0, 1e-10);
    Prepared<Pgs, Law::coulomb, Dense> b(env, coulomb.lambda);
    for (const double d : first_step<Law::coulomb, ConeKind::friction, 3>(b).d) EXPECT_NEAR(d, 0, 1e-10);
  }
}

TEST(LocalSolve, AProximalPointAddsDeSaxcesTermUnderCoulombsLawOnly) {
  const double y[] = {-1.0, 3.0, 4.0};
  double convex[] = {0.0, 0.0, 0.0};
  proximal_point(ConeShape<ConeKind::friction, 3>{}, convex, y, 1.0, 0.0, 0.0, Law::convex);
  // z = (1, -3, -4): onto the cone, half of 1 + 5.
  EXPECT_EQ(convex[0], 3.0);
  double coulomb[] = {0.0, 0.0, 0.0};
  proximal_point(ConeShape<ConeKind::friction, 3>{}, coulomb, y, 1.0, 0.0, 0.0, Law::coulomb);
  // z = (1 - 5, -3, -4): half of -4 + 5.
  EXPECT_EQ(coulomb[0], 0.5);
}

/// Distance of x from a law on a cone with the given mu, in the unit of w. The nearer counts of sticking and of
/// sliding against the direction of x.
template <int M>
double distance_from_law(Law law, const double (&B)[M][M], const double (&b)[M], const double (&mu)[M],
                         const double (&x)[M]) {
  double pull = 0;
  for (int k = 1; k < M; ++k) pull += x[k] * x[k];
  pull = std::sqrt(pull);
  double w[M], slip[M], sticks = 0, along = 0, square = 0;
  for (int i = 0; i < M; ++i) {
    w[i] = b[i];
    for (int j = 0; j < M; ++j) w[i] += B[i][j] * x[j] / mu[i];
    if (i == 0) {
      slip[i] = law == Law::convex ? 1 : 0;
    } else {
      slip[i] = pull > 0 ? -x[i] / pull / mu[i] : 0;
    }
    sticks += w[i] * w[i];
    along += slip[i] * w[i];
    square += slip[i] * slip[i];
  }
  const double speed = square > 0 ? std::max(0.0, along / square) : 0;
  double slides = (pull - x[0]) * (pull - x[0]);
  for (int i = 0; i < M; ++i) slides += (w[i] - speed * slip[i]) * (w[i] - speed * slip[i]);
  const double outside = std::max(0.0, pull - x[0]);
  return std::sqrt(std::min(sticks, slides)) + outside;
}

/// The distance after 50 steps of one contact whose last axes have friction of their own, in the given precision.
template <class Real, int M>
double distance_after_steps(Law law, double own, int own_axes) {
  const double motion[] = {-9.81, 0.3, 0.2, 0.01, 0.02, -0.01};
  double mu[M], b[M], B[M][M];
  UnevenCone<Real, M> cone;
  for (int i = 0; i < M; ++i) {
    mu[i] = i >= M - own_axes ? own : 1;
    b[i] = motion[i];
  }
  for (int i = 0; i < M; ++i)
    for (int j = 0; j < M; ++j) {
      B[i][j] = (i == j ? 1 : 0.15) * mu[i] * mu[j];
      cone.block[i][j] = static_cast<Real>(B[i][j]);
    }
  Real x[M] = {};
  cone.inv_n = cone.inv_t = cone.omega = Real(1);
  for (int step = 0; step < 50; ++step) {
    Real d[M];
    for (int i = 0; i < M; ++i) {
      cone.x[i] = x[i];
      cone.y[i] = static_cast<Real>(b[i] * mu[i]);
      for (int j = 0; j < M; ++j) cone.y[i] = fma_(cone.block[i][j], x[j], cone.y[i]);
    }
    if (law == Law::coulomb) {
      uneven_coulomb_step(cone, d);
    } else {
      uneven_convex_step(cone, d);
    }
    for (int i = 0; i < M; ++i) x[i] = x[i] + d[i];
  }
  double end[M];
  for (int i = 0; i < M; ++i) end[i] = static_cast<double>(x[i]);
  return distance_from_law<M>(law, B, b, mu, end) / 9.81;
}

TEST(LocalSolve, AxesOfAnyFrictionReachTheirLawInFiftySteps) {
  for (const Law law : {Law::coulomb, Law::convex})
    for (double own = 1e-6; own < 2e6; own *= 10) {
      EXPECT_LT((distance_after_steps<double, 3>(law, own, 1)), 1e-12) << own;
      EXPECT_LT((distance_after_steps<double, 4>(law, own, 1)), 1e-12) << own;
      EXPECT_LT((distance_after_steps<double, 6>(law, own, 3)), 1e-12) << own;
      EXPECT_LT((distance_after_steps<float, 3>(law, own, 1)), 1e-6) << own;
      EXPECT_LT((distance_after_steps<float, 4>(law, own, 1)), 1e-6) << own;
      EXPECT_LT((distance_after_steps<float, 6>(law, own, 3)), 1e-6) << own;
    }
}

}  // namespace
