#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "scenes/body_scenes.hpp"
#include "stiction/residual.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/systems/body_systems.hpp"

namespace stiction::test {

namespace {

using Env = BodyEnvironment<double>;

BodySolverOptions tight(Law law = Law::coulomb) {
  BodySolverOptions options;
  options.law = law;
  options.iterations = 4000;
  options.tolerance = 1e-11;
  options.threads = 1;
  return options;
}

BodySolution<double> solve_one(const Env& env, const BodySolverOptions& options, const TimeStepping& stepping = {}) {
  return solve_bodies(batch_of<double>({env}), stepping, options);
}

/// Rounding of a handful of operations on numbers of size one.
constexpr double kFew = 1e-9;

}  // namespace

TEST(Bodies, ABallAtRestIsHeldByItsWeight) {
  Env env = ball_on_floor(0.1, 2.0, 0.5);
  env.bodies[0].twist_change[2] = -kFall;
  const auto solution = solve_one(env, tight());
  EXPECT_EQ(solution.status[0].code, EnvCode::solved);
  EXPECT_NEAR(solution.impulse[0], 2.0 * kFall, kFew);
  for (const double v : solution.twist) EXPECT_NEAR(v, 0, kFew);
}

TEST(Bodies, ASlidingBallIsBrakedByMuAndSetSpinning) {
  const double mu = 0.3, mass = 2, radius = 0.1;
  Env env = ball_on_floor(radius, mass, mu);
  env.bodies[0].twist = {1, 0, 0, 0, 0, 0};
  env.bodies[0].twist_change[2] = -kFall;
  const auto solution = solve_one(env, tight());
  // Coulomb: friction mu m g dt against the motion; torque -r z x friction spins it up about y.
  const double friction = mu * mass * kFall;
  EXPECT_NEAR(solution.impulse[0], mass * kFall, kFew);
  EXPECT_NEAR(solution.twist[0], 1 - friction / mass, kFew);
  EXPECT_NEAR(solution.twist[4], radius * friction / (0.4 * mass * radius * radius), kFew);
  EXPECT_NEAR(solution.twist[2], 0, kFew);
}

TEST(Bodies, ASlowBallSticksAndRolls) {
  const double radius = 0.1;
  Env env = ball_on_floor(radius, 2.0, 1.0);
  env.bodies[0].twist = {0.01, 0, 0, 0, 0, 0};
  env.bodies[0].twist_change[2] = -kFall;
  const auto solution = solve_one(env, tight());
  // Momentum about the contact point stays: v + 0.4 r w = v0 with v = r w.
  EXPECT_NEAR(solution.twist[0], 0.01 / 1.4, kFew);
  EXPECT_NEAR(solution.twist[4], 0.01 / 1.4 / radius, 10 * kFew);
}

TEST(Bodies, AFastBallBouncesAndOneBelowTheThresholdDoesNot) {
  Env env = ball_on_floor(0.1, 2.0, 0.0);
  env.contacts[0].restitution = 0.5;
  env.bodies[0].twist[2] = -2;
  env.bodies[0].twist_change[2] = -kFall;
  EXPECT_NEAR(solve_one(env, tight()).twist[2], 1, kFew);
  env.bodies[0].twist[2] = -0.1;
  EXPECT_NEAR(solve_one(env, tight()).twist[2], 0, kFew);
  // In sub-steps it bounces in the first one, and flies under its weight in the other three.
  env.bodies[0].twist[2] = -2;
  BodySolverOptions options = tight();
  options.substeps = 4;
  options.iterations = 50;
  EXPECT_NEAR(solve_one(env, options).twist[2], 1 - 0.75 * kFall, kFew);
}

TEST(Bodies, AGapMayCloseButNotMore) {
  Env env = ball_on_floor(0.1, 2.0, 0.5);
  env.contacts[0].depth = -0.002;
  env.bodies[0].twist[2] = -1;
  EXPECT_NEAR(solve_one(env, tight()).twist[2], -0.002 / 0.005, kFew);
  env.bodies[0].twist[2] = -0.3;
  EXPECT_NEAR(solve_one(env, tight()).twist[2], -0.3, kFew);
  // A gap that one sub-step leaves half closed is closed by the second: 1 mm of 2 mm each.
  env.bodies[0].twist[2] = -0.4;
  BodySolverOptions options = tight();
  options.substeps = 2;
  options.iterations = 20;
  EXPECT_NEAR(solve_one(env, options).twist[2], -0.4, kFew);
  env.contacts[0].depth = -0.001;
  EXPECT_NEAR(solve_one(env, options).twist[2], 0, kFew);
}

TEST(Bodies, APenetrationBeyondTheSlopIsUndoneByItsShare) {
  Env env = ball_on_floor(0.1, 2.0, 0.5);
  env.contacts[0].depth = 0.003;
  TimeStepping stepping;
  stepping.slop = 0.001;
  stepping.erp = 0.25;
  EXPECT_NEAR(solve_one(env, tight(), stepping).twist[2], 0.25 * 0.002 / 0.005, kFew);
  stepping.slop = 0.004;
  EXPECT_NEAR(solve_one(env, tight(), stepping).twist[2], 0, kFew);
}

TEST(Bodies, ComplianceLetsAContactYield) {
  Env env = ball_on_floor(0.1, 2.0, 0.0);
  env.bodies[0].twist_change[2] = -kFall;
  TimeStepping stepping;
  stepping.cfm = 0.01;
  const auto solution = solve_one(env, tight(), stepping);
  // (1/m + cfm/dt) lambda = g dt, and the ball gives way by cfm/dt lambda.
  const double r = 0.01 / 0.005;
  EXPECT_NEAR(solution.impulse[0], kFall / (0.5 + r), kFew);
  EXPECT_NEAR(solution.twist[2], -r * solution.impulse[0], kFew);
}

TEST(Bodies, AKinematicFloorDragsAndIsNotPushed) {
  Env env = ball_on_floor(0.1, 2.0, 0.4);
  Env::Body belt;
  belt.kinematic = true;
  belt.twist = {3, 0, 0, 0, 0, 0};
  belt.twist_change = {7, 7, 7, 7, 7, 7};
  env.bodies.push_back(belt);
  env.contacts[0].body_a = 1;
  env.bodies[0].twist_change[2] = -kFall;
  const auto solution = solve_one(env, tight());
  EXPECT_NEAR(solution.twist[0], 0.4 * kFall, kFew);
  EXPECT_EQ(std::vector<double>(solution.twist.begin() + 6, solution.twist.end()),
            (std::vector<double>{3, 0, 0, 0, 0, 0}));
}

/// The environment assembled densely, judged by code that shares nothing with the solver.
TEST(Bodies, ResidualVelocitiesAndMotionAgreeWithTheAssembledSystem) {
  TimeStepping stepping;
  stepping.slop = 1e-4;
  for (const Law law : {Law::coulomb, Law::convex})
    for (const double cfm : {0.0, 1e-5})
      for (const Env& env : {scenes::make_body_pile(3, 60), scenes::make_body_stack(5, 4)}) {
        stepping.cfm = cfm;
        BodySolverOptions options = tight(law);
        options.tolerance = 1e-5;
        options.iterations = 40000;
        const auto solution = solve_one(env, options, stepping);
        SCOPED_TRACE(std::string(to_string(law)) + ", cfm " + std::to_string(cfm) + ", bodies " +
                     std::to_string(env.bodies.size()) + ", residual " + std::to_string(solution.status[0].residual));
        EXPECT_EQ(solution.status[0].code, EnvCode::solved);

        const Environment<double> system = scenes::delassus_form(env, stepping);
        ContactBatch<double> batch(law);
        batch.add(system);
        const Residual judged = verify(batch.view(), std::span<const double>(solution.impulse)).at(0);
        // The judge's own rounding: 1e-16 of entries of A lambda, which are some hundred times b.
        EXPECT_NEAR(judged.relative, solution.status[0].residual, 1e-11);
        EXPECT_LE(judged.relative, 1.01e-5);

        const scenes::BodyMatrices m = scenes::body_matrices(env);
        const auto rows = static_cast<std::size_t>(m.rows), dofs = static_cast<std::size_t>(m.dofs);
        std::vector<double> push(dofs, 0);
        for (std::size_t i = 0; i < rows; ++i)
          for (std::size_t k = 0; k < dofs; ++k) push[k] += m.J[i * dofs + k] * solution.impulse[i];
        for (std::size_t i = 0; i < dofs; ++i) {
          double v = m.v_free[i];
          for (std::size_t k = 0; k < dofs; ++k) v += m.inv_M[i * dofs + k] * push[k];
          EXPECT_NEAR(solution.twist[i], v, 1e-12) << "dof " << i;
        }
        for (std::size_t i = 0; i < rows; ++i) {
          double w = system.b[i] + system.R[i] * solution.impulse[i];
          for (std::size_t k = 0; k < dofs; ++k) w += m.J[i * dofs + k] * (solution.twist[k] - m.v_free[k]);
          EXPECT_NEAR(solution.w[i], w, 1e-12) << "row " << i;
        }
      }
}

/// If the answer is unique in velocities (convex law with compliance), another solver finds the same ones.
TEST(Bodies, VelocitiesAgreeWithTheContactSolver) {
  TimeStepping stepping;
  stepping.cfm = 1e-4;
  const Env env = scenes::make_body_pile(11, 40);
  BodySolverOptions options = tight(Law::convex);
  options.iterations = 50000;
  const auto solution = solve_one(env, options, stepping);
  ASSERT_EQ(solution.status[0].code, EnvCode::solved);

  ContactBatch<double> batch(Law::convex);
  batch.add(scenes::delassus_form(env, stepping));
  SolverOptions contact_options;
  contact_options.solver = SolverKind::npgs;
  contact_options.tolerance = 1e-11;
  contact_options.max_iterations = 50000;
  contact_options.threads = 1;
  const auto expected = solve(batch, contact_options);
  ASSERT_EQ(expected.status[0].code, EnvCode::solved);
  // R > 0: A + R is well conditioned, and a residual of 1e-11 bounds w to some 1e-8 of b.
  for (std::size_t i = 0; i < expected.w.size(); ++i) EXPECT_NEAR(solution.w[i], expected.w[i], 1e-8) << "row " << i;
}

TEST(Bodies, ContactsBetweenBodiesChangeNoTotalMomentum) {
  Env env = random_bodies(4, 6, 30);
  for (auto& body : env.bodies) body.kinematic = false;
  // Points in space, so that both arms meet; the world is taken out.
  std::vector<std::array<double, 3>> center;
  for (std::size_t k = 0; k < env.bodies.size(); ++k)
    center.push_back({0.3 * static_cast<double>(k), 0.1 * static_cast<double>(k * k), -0.2 * static_cast<double>(k)});
  for (auto& contact : env.contacts) {
    if (contact.body_a < 0) contact.body_a = (contact.body_b + 1) % 6;
    if (contact.body_b < 0) contact.body_b = (contact.body_a + 1) % 6;
    for (std::size_t i = 0; i < 3; ++i)
      contact.arm_a[i] = contact.arm_b[i] + center[static_cast<std::size_t>(contact.body_b)][i] -
                         center[static_cast<std::size_t>(contact.body_a)][i];
  }
  for (auto& body : env.bodies) {
    body.inv_inertia = {2, 0, 0, 2, 0, 2};
    body.twist_change = {};
  }
  for (const Index substeps : {1, 3}) {
    BodySolverOptions options;
    options.iterations = 40;
    options.substeps = substeps;
    const auto solution = solve_one(env, options);
    ASSERT_GT(*std::max_element(solution.impulse.begin(), solution.impulse.end()), 0.01);
    std::array<double, 6> before{}, after{};
    const auto add = [&](std::array<double, 6>& total, const double* twist, std::size_t k) {
      const double mass = 1 / env.bodies[k].inv_mass;
      const std::array<double, 3>& c = center[k];
      for (std::size_t i = 0; i < 3; ++i) {
        const std::size_t j = (i + 1) % 3, l = (i + 2) % 3;
        total[i] += mass * twist[i];
        total[3 + i] += 0.5 * twist[3 + i] + mass * (c[j] * twist[l] - c[l] * twist[j]);
      }
    };
    for (std::size_t k = 0; k < env.bodies.size(); ++k) {
      add(before, env.bodies[k].twist.data(), k);
      add(after, solution.twist.data() + 6 * k, k);
    }
    for (std::size_t i = 0; i < 6; ++i) EXPECT_NEAR(after[i], before[i], 1e-12) << i << ", sub-steps " << substeps;
  }
}

TEST(Bodies, AnEnvironmentOverCapacityKeepsItsDeepestContacts) {
  Env env = random_bodies(8, 5, 24);
  for (std::size_t c = 0; c < env.contacts.size(); ++c) env.contacts[c].depth = 1e-3 * static_cast<double>(c * 7 % 5);
  BodySolverOptions options;
  options.iterations = 30;
  options.max_contacts_per_env = 10;
  const auto solution = solve_one(env, options);
  EXPECT_EQ(solution.status[0].flags, static_cast<std::uint32_t>(kFlagContactsDropped));

  // By brute force: a contact stays if fewer than ten are deeper, or as deep and before it.
  Env fewer = env;
  fewer.contacts.clear();
  std::vector<std::size_t> kept;
  for (std::size_t c = 0; c < env.contacts.size(); ++c) {
    std::size_t ahead = 0;
    for (std::size_t d = 0; d < env.contacts.size(); ++d)
      if (env.contacts[d].depth > env.contacts[c].depth || (env.contacts[d].depth == env.contacts[c].depth && d < c))
        ++ahead;
    if (ahead >= 10) continue;
    kept.push_back(c);
    fewer.contacts.push_back(env.contacts[c]);
  }
  ASSERT_EQ(kept.size(), 10U);
  options.max_contacts_per_env = 0;
  const auto expected = solve_one(fewer, options);
  EXPECT_EQ(expected.status[0].flags, 0U);
  std::vector<double> impulse(3 * env.contacts.size(), 0.0);
  for (std::size_t k = 0; k < kept.size(); ++k)
    for (std::size_t i = 0; i < 3; ++i) impulse[3 * kept[k] + i] = expected.impulse[3 * k + i];
  EXPECT_TRUE(same_bits(std::span<const double>(impulse), std::span<const double>(solution.impulse)));
  EXPECT_TRUE(same_bits(std::span<const double>(expected.twist), std::span<const double>(solution.twist)));
}

TEST(Bodies, AWarmStartAtTheAnswerNeedsNoSweep) {
  const Env env = scenes::make_body_stack(2, 3);
  BodySolverOptions options = tight();
  options.tolerance = 1e-7;
  options.iterations = 20000;
  const auto batch = batch_of<double>({env});
  const auto cold = solve_bodies(batch, {}, options);
  ASSERT_EQ(cold.status[0].code, EnvCode::solved);
  ASSERT_GT(cold.status[0].iterations, 0);
  options.tolerance = 1.01 * cold.status[0].residual;
  const auto warm = solve_bodies(batch, {}, options, Device::cpu(), std::span<const double>(cold.impulse));
  EXPECT_EQ(warm.status[0].code, EnvCode::solved);
  EXPECT_EQ(warm.status[0].iterations, 0);

  for (const double none : {std::numeric_limits<double>::infinity(), 1e300}) {
    std::vector<double> broken = cold.impulse;
    broken[4] = none;
    const auto rejected = solve_bodies(batch, {}, options, Device::cpu(), std::span<const double>(broken));
    EXPECT_EQ(rejected.status[0].flags, static_cast<std::uint32_t>(kFlagWarmStartRejected));
    EXPECT_GT(rejected.status[0].iterations, 0);
  }
}

}  // namespace stiction::test
