// Boxed friction of bodies: answers by hand, by enumeration of all states, and by the matrix of the same bodies.
// Refusals; hostile numbers.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "scenes/body_scenes.hpp"
#include "stiction/residual.hpp"
#include "stiction/world_derivative.hpp"
#include "tests/support/error_message.hpp"
#include "tests/support/oracles/box_friction_oracle.hpp"
#include "tests/support/systems/body_systems.hpp"
#include "tests/support/systems/boxed.hpp"
#include "tests/support/systems/small_systems.hpp"
#include "tests/support/systems/worlds.hpp"

namespace stiction::test {
namespace {

using Env = BodyEnvironment<double>;

BodySolverOptions boxed_options(double tolerance = 1e-11, Index iterations = 20000) {
  BodySolverOptions options;
  options.box_friction = true;
  options.iterations = iterations;
  options.tolerance = tolerance;
  options.threads = 1;
  return options;
}

BodySolution<double> solve_one(const Env& env, const BodySolverOptions& options, const TimeStepping& stepping = {}) {
  return solve_bodies(batch_of<double>({env}), stepping, options);
}

/// A body of 2 kg that cannot turn, on the floor: its tangents are x and y of the world.
Env sledge(double mu, double vx, double vy) {
  Env env = ball_on_floor(0.1, 2.0, mu);
  env.bodies[0].inv_inertia = {};
  env.bodies[0].twist = {vx, vy, 0, 0, 0, 0};
  env.bodies[0].twist_change[2] = -kFall;
  return env;
}

/// Rounding of a handful of operations on numbers of size one.
constexpr double kFew = 1e-9;

// Friction takes mu g dt from each axis, or all that the axis has. Coulomb's disk takes mu g dt from the whole.
TEST(BodiesBoxFriction, ASledgeByHand) {
  const double brake = 0.5 * kFall;
  const auto expect_twist = [&](double vx, double vy, double x, double y) {
    for (const bool momentum : {false, true})
      for (const Law law : {Law::coulomb, Law::convex}) {
        BodySolverOptions options = boxed_options();
        options.momentum = momentum;
        options.law = law;  // not read
        const auto solution = solve_one(sledge(0.5, vx, vy), options);
        EXPECT_EQ(solution.status[0].code, EnvCode::solved);
        EXPECT_NEAR(solution.twist[0], x, kFew);
        EXPECT_NEAR(solution.twist[1], y, kFew);
        EXPECT_NEAR(solution.impulse[0], 2 * kFall, kFew);
        EXPECT_NEAR(solution.impulse[1], 2 * (x - vx), kFew);
        EXPECT_NEAR(solution.impulse[2], 2 * (y - vy), kFew);
      }
  };
  expect_twist(0.9 * brake, -0.9 * brake, 0, 0);  // held: 1.27 times a disk's limit
  expect_twist(1, 0, 1 - brake, 0);               // along an axis: as Coulomb's
  expect_twist(1, 1, 1 - brake, 1 - brake);       // between two axes: braked by sqrt(2) mu
  expect_twist(-1, 0.5 * brake, brake - 1, 0);    // slides along one axis, sticks along the other
  BodySolverOptions disk = boxed_options();
  disk.box_friction = false;
  const auto slides = solve_one(sledge(0.5, 0.9 * brake, -0.9 * brake), disk);
  EXPECT_NEAR(slides.twist[0], (0.9 - std::sqrt(0.5)) * brake, kFew);
}

/// A step of a world of bodies as an environment of boxed contacts with the matrix A.
Environment<double> boxed_form(const Env& env, const TimeStepping& stepping) {
  return boxed(scenes::delassus_form(env, stepping));
}

TEST(BodiesBoxFriction, EnumerationOfAllStatesFindsTheSameImpulses) {
  TimeStepping stepping;
  stepping.cfm = 1e-3;
  int unique = 0, inside = 0, at_a_bound = 0, corners = 0, open = 0;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    Env env = random_bodies(seed, 3, 2 + static_cast<Index>(seed % 2));
    for (auto& contact : env.contacts) contact.mu = 0.6 * contact.mu;
    const Environment<double> system = boxed_form(env, stepping);
    const oracle::BoxFrictionStates states(system);
    if (states.found.size() != 1) continue;  // several, or none: mu is not small beside the couplings
    ++unique;
    const std::vector<double>& expected = states.found.front();
    for (const bool momentum : {false, true}) {
      BodySolverOptions options = boxed_options();
      options.momentum = momentum;
      const auto solution = solve_one(env, options, stepping);
      ASSERT_EQ(solution.status[0].code, EnvCode::solved) << "seed " << seed;
      for (std::size_t i = 0; i < expected.size(); ++i)
        EXPECT_NEAR(solution.impulse[i], expected[i], 1e-8) << "seed " << seed << ", row " << i;
      EXPECT_LT(oracle::box_friction_violation(system, solution.impulse), 1e-9) << "seed " << seed;
    }
    for (std::size_t c = 0; c < env.contacts.size(); ++c) {
      const double bound = env.contacts[c].mu * expected[3 * c];
      int bounds = 0;
      for (std::size_t k = 1; k < 3; ++k) bounds += std::abs(expected[3 * c + k]) > 0.999999 * bound ? 1 : 0;
      (bound <= 0 ? open : bounds == 0 ? inside : bounds == 1 ? at_a_bound : corners) += 1;
    }
  }
  // At least so many of each, or the enumeration has not covered the law.
  EXPECT_GE(unique, 50);
  EXPECT_GE(std::min({inside, at_a_bound, corners, open}), 5)
      << inside << " inside, " << at_a_bound << " at a bound, " << corners << " in a corner, " << open << " open";
}

/// Larger scenes: the solver of matrices on A of the same bodies, a judge that shares nothing with either, and
/// products.
TEST(BodiesBoxFriction, AMatrixOfTheSameBodiesHasTheSameMotion) {
  TimeStepping stepping;
  stepping.cfm = 1e-4;
  for (const Env& env : {scenes::make_body_pile(3, 40), scenes::make_body_stack(5, 4), random_bodies(9, 12, 30)}) {
    const Environment<double> system = boxed_form(env, stepping);
    const ContactBatch<double> batch = batch_of({system}, Law::coulomb);
    const auto solution = solve_one(env, boxed_options(1e-10, 100000), stepping);
    SCOPED_TRACE(std::to_string(env.contacts.size()) + " contacts");
    ASSERT_EQ(solution.status[0].code, EnvCode::solved);
    const Residual judged = verify(batch.view(), std::span<const double>(solution.impulse)).at(0);
    EXPECT_LE(judged.relative, 1.1e-10);
    EXPECT_NEAR(judged.relative, solution.status[0].residual, 1e-12);
    EXPECT_LT(oracle::box_friction_violation(system, solution.impulse), 1e-8);
    const auto by_matrix = solve(batch, options(SolverKind::npgs, 1e-10, 100000));
    ASSERT_EQ(by_matrix.status[0].code, EnvCode::solved);
    for (std::size_t i = 0; i < by_matrix.w.size(); ++i)
      EXPECT_NEAR(solution.w[i], by_matrix.w[i], 1e-6) << "row " << i;
  }
}

TEST(BodiesBoxFriction, SubStepsAndWarmStartsLeadToTheSameAnswer) {
  // Each sub-step brakes by its share, until an axis stands: 0.3 brakes of 1 within the third of four.
  const double brake = 0.5 * kFall;
  BodySolverOptions options = boxed_options(0, 40);
  options.substeps = 4;
  const auto solution = solve_one(sledge(0.5, 2, 0.3 * brake), options);
  EXPECT_NEAR(solution.twist[0], 2 - brake, kFew);
  EXPECT_NEAR(solution.twist[1], 0, kFew);
  EXPECT_NEAR(solution.impulse[1], -2 * brake, kFew);
  EXPECT_NEAR(solution.impulse[2], -2 * 0.3 * brake, kFew);
  // A corner of the box is no point of the cone: a start there is an answer, and no sweep is needed.
  const Env env = sledge(0.5, 1, 1);
  const std::vector<double> corner{2 * kFall, -2 * brake, -2 * brake};
  const auto warm =
      solve_bodies(batch_of<double>({env}), {}, boxed_options(1e-9), Device::cpu(), std::span<const double>(corner));
  EXPECT_EQ(warm.status[0].iterations, 0);
  EXPECT_EQ(warm.status[0].code, EnvCode::solved);
  // One beyond it is clamped to it.
  const std::vector<double> outside{2 * kFall, -7, -7};
  const auto clamped =
      solve_bodies(batch_of<double>({env}), {}, boxed_options(1e-9), Device::cpu(), std::span<const double>(outside));
  EXPECT_EQ(clamped.status[0].iterations, 0);
  EXPECT_EQ(clamped.impulse, warm.impulse);
}

TEST(BodiesBoxFriction, HostileNumbersAreFlagged) {
  const double infinity = std::numeric_limits<double>::infinity();
  BodySolverOptions options = boxed_options(1e-9, 100);
  options.invalid = InvalidPolicy::isolate;
  const auto with_mu = [&](double mu) {
    Env env = random_bodies(6, 4, 9);
    env.contacts[4].mu = mu;
    return solve_one(env, options);
  };
  for (const double mu : {std::numeric_limits<double>::quiet_NaN(), infinity, -infinity, -0.1}) {
    const auto solution = with_mu(mu);
    EXPECT_EQ(solution.status[0].code, EnvCode::invalid_input) << mu;
    const auto flag = mu == -0.1 ? kFlagNegativeFriction : kFlagNonFiniteInput;
    EXPECT_NE(solution.status[0].flags & static_cast<std::uint32_t>(flag), 0U) << mu;
    for (const double v : solution.impulse) EXPECT_EQ(v, 0);
  }
  for (const double mu : {0.0, 1e-300, 1e-30, 1e30, 1e300}) {
    const auto solution = with_mu(mu);
    EXPECT_NE(solution.status[0].code, EnvCode::invalid_input) << mu;
    for (const double v : solution.impulse) EXPECT_TRUE(std::isfinite(v)) << mu;
    for (const double v : solution.twist) EXPECT_TRUE(std::isfinite(v)) << mu;
  }
  // Nothing slides on nothing: mu 0 is a frictionless contact.
  const auto smooth = solve_one(sledge(0, 1, 2), options);
  EXPECT_EQ(smooth.impulse[1], 0);
  EXPECT_EQ(smooth.impulse[2], 0);
  EXPECT_EQ(smooth.twist[0], 1);
}

TEST(BodiesBoxFriction, WhatHasNoneRefusesItByName) {
  BodySolverOptions newton = boxed_options();
  newton.method = BodyMethod::newton;
  EXPECT_THAT(error_message([&] { solve_one(sledge(0.5, 1, 0), newton); }), testing::HasSubstr("solver si"));
  BodySolverOptions bad = boxed_options();
  bad.law = static_cast<Law>(2);
  EXPECT_THAT(error_message([&] { solve_one(sledge(0.5, 1, 0), bad); }), testing::HasSubstr("law = 2"));
  WorldDescription description;
  add_floor(description);
  add_body(description, ShapeKind::box, {0.1, 0.1, 0.1});
  WorldOptions options;
  options.solver = boxed_options();
  World<double> world(Device::cpu(), description, 1, options);
  EXPECT_THAT(error_message([&] { const WorldStep<double> step(world); }), testing::HasSubstr("box_friction"));
}

}  // namespace
}  // namespace stiction::test
