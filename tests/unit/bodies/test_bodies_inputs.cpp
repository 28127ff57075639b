#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <string>

#include "scenes/body_scenes.hpp"
#include "tests/support/error_message.hpp"
#include "tests/support/systems/body_systems.hpp"

/// Bodies at the edge of a solve's range, and beyond it.
namespace stiction::test {

namespace {

using Env = BodyEnvironment<double>;

}  // namespace

TEST(BodiesInputs, NothingToSolveIsSolved) {
  EXPECT_TRUE(solve_bodies(BodyBatch<float>{}).status.empty());
  Env flight;
  flight.bodies.resize(1);
  flight.bodies[0].twist = {1, 2, 3, 4, 5, 6};
  flight.bodies[0].twist_change = {0, 0, -1, 0, 0, 0};
  const auto solution = solve_bodies(batch_of<double>({Env{}, flight, Env{}}));
  for (const EnvStatus& status : solution.status) {
    EXPECT_EQ(status.code, EnvCode::solved);
    EXPECT_EQ(status.residual, 0);
  }
  EXPECT_EQ(solution.twist, (std::vector<double>{1, 2, 2, 4, 5, 6}));
}

TEST(BodiesInputs, MassesBeyondSinglePrecisionEndInAFiniteAnswer) {
  BodySolverOptions options;
  options.substeps = 2;
  const auto solution = solve_bodies(batch_of<float>({beyond_single_precision()}), {}, options);
  EXPECT_NE(solution.status[0].code, EnvCode::solved);
  for (const float v : solution.twist) EXPECT_TRUE(std::isfinite(v));
  for (const float v : solution.impulse) EXPECT_TRUE(std::isfinite(v));
}

/// The body turns so fast, and the arm is so long, that the velocity of the contact is infinity less infinity.
TEST(BodiesInputs, AMotionThatNoNumberTellsIsTheLargestNumber) {
  constexpr double kLargest = std::numeric_limits<double>::max();
  Env env;
  env.bodies.resize(1);
  env.bodies[0].inv_mass = 1;
  env.bodies[0].twist = {-8, -8, -8, kLargest, -8, -8};
  env.contacts.resize(1);
  env.contacts[0].body_a = -1;
  env.contacts[0].body_b = 0;
  env.contacts[0].arm_b = {kLargest, -1, kLargest};
  env.contacts[0].normal = {-1, 0, 0};
  env.contacts[0].mu = kLargest;
  for (const BodyMethod method : {BodyMethod::impulses, BodyMethod::newton}) {
    BodySolverOptions options;
    options.method = method;
    options.iterations = 3;
    const auto solution = solve_bodies(batch_of<double>({env, env, env, env, env}), {}, options);
    EXPECT_NE(solution.status[0].code, EnvCode::solved);
    for (const double v : solution.twist) EXPECT_TRUE(std::isfinite(v));
    for (const double v : solution.impulse) EXPECT_TRUE(std::isfinite(v));
    for (const double v : solution.w) EXPECT_TRUE(std::isfinite(v));
  }
}

TEST(BodiesInputs, EveryNumberOfABatchIsLookedAt) {
  const double nan = std::numeric_limits<double>::quiet_NaN(), infinite = std::numeric_limits<double>::infinity();
  struct Case {
    const char* message;
    std::function<void(Env&)> spoil;
  };
  const Case cases[] = {
      {"twist[env 1, body 2] = inf", [&](Env& env) { env.bodies[2].twist[5] = infinite; }},
      {"twist_change[env 1, body 2] = nan", [&](Env& env) { env.bodies[2].twist_change[0] = nan; }},
      {"inv_inertia[env 1, body 2] = nan", [&](Env& env) { env.bodies[2].inv_inertia[3] = nan; }},
      {"inv_mass[env 1, body 2] = -1", [&](Env& env) { env.bodies[2].inv_mass = -1; }},
      {"inv_mass[env 1, body 2] = inf", [&](Env& env) { env.bodies[2].inv_mass = infinite; }},
      {"arm_a[env 1, contact 3] = nan", [&](Env& env) { env.contacts[3].arm_a[2] = nan; }},
      {"arm_b[env 1, contact 3] = -inf", [&](Env& env) { env.contacts[3].arm_b[0] = -infinite; }},
      {"normal[env 1, contact 3] = nan", [&](Env& env) { env.contacts[3].normal[1] = nan; }},
      {"normal[env 1, contact 3] = 0 long", [&](Env& env) { env.contacts[3].normal = {}; }},
      {"mu[env 1, contact 3] = -1", [&](Env& env) { env.contacts[3].mu = -1; }},
      {"mu[env 1, contact 3] = inf", [&](Env& env) { env.contacts[3].mu = infinite; }},
      {"depth[env 1, contact 3] = nan", [&](Env& env) { env.contacts[3].depth = nan; }},
      {"restitution[env 1, contact 3] = 2", [&](Env& env) { env.contacts[3].restitution = 2; }},
      {"restitution[env 1, contact 3] = nan", [&](Env& env) { env.contacts[3].restitution = nan; }},
  };
  const Env sound = scenes::make_body_stack(1, 3);
  EXPECT_TRUE(validate(batch_of<double>({sound, sound, sound}).view()).empty());
  for (const Case& one : cases) {
    Env spoilt = sound;
    one.spoil(spoilt);
    const auto batch = batch_of<double>({sound, spoilt, sound});
    const auto defects = validate(batch.view());
    ASSERT_EQ(defects.size(), 1U) << one.message;
    EXPECT_THAT(defects[0].message, ::testing::HasSubstr(one.message));
  }
  for (const Index body : {-2, static_cast<Index>(sound.bodies.size())}) {
    auto batch = batch_of<double>({sound, sound, sound});
    auto view = batch.view();
    std::vector<Index> sides(view.body_b, view.body_b + view.contact_count);
    sides[static_cast<std::size_t>(view.env_contact_offsets[1]) + 3] = body;
    view.body_b = sides.data();
    const auto defects = validate(view);
    ASSERT_FALSE(defects.empty());
    EXPECT_THAT(defects[0].message, ::testing::HasSubstr("body_b[env 1, contact 3] = " + std::to_string(body)));
  }
  Env moved = sound;
  moved.bodies[2].kinematic = true;  // unused numbers may be anything
  moved.bodies[2].inv_mass = moved.bodies[2].inv_inertia[0] = moved.bodies[2].twist_change[1] = nan;
  EXPECT_TRUE(validate(batch_of<double>({sound, moved, sound}).view()).empty());
}

TEST(BodiesInputs, MisuseIsNamed) {
  using ::testing::HasSubstr;
  BodyBatch<double> batch;
  Env env = ball_on_floor(0.1, 1, 0.5);
  env.contacts[0].body_b = 7;
  EXPECT_THAT(error_message([&] { batch.add(env); }), HasSubstr("contacts[0].body_b = 7"));
  env.contacts[0].body_b = -1;
  EXPECT_THAT(error_message([&] { batch.add(env); }), HasSubstr("equals body_b"));
  EXPECT_EQ(batch.env_count(), 0);

  env = ball_on_floor(0.1, 1, -0.5);
  EXPECT_THAT(error_message([&] { solve_bodies(batch_of<double>({env})); }), HasSubstr("mu[env 0, contact 0] = -0.5"));
  env = ball_on_floor(0.1, 1, 0.5);
  env.contacts[0].normal = {0, 0, 2};
  EXPECT_THAT(error_message([&] { solve_bodies(batch_of<double>({env})); }),
              HasSubstr("normal[env 0, contact 0] = 2 long"));
  env = ball_on_floor(0.1, 1, 0.5);
  env.bodies[0].twist[1] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(error_message([&] { solve_bodies(batch_of<double>({env})); }), HasSubstr("twist[env 0, body 0] = nan"));

  const auto one = batch_of<double>({ball_on_floor(1, 1, 1)});
  TimeStepping stepping;
  stepping.dt = 0;
  EXPECT_THAT(error_message([&] { solve_bodies(one, stepping); }), HasSubstr("dt = 0"));
  BodySolverOptions options;
  options.substeps = 0;
  EXPECT_THAT(error_message([&] { solve_bodies(one, {}, options); }), HasSubstr("substeps = 0"));

  const auto other = batch_of<double>({random_bodies(1, 3, 5)});
  const BodySolver solver(Device::cpu(), {}, {});
  std::vector<double> room(100);
  std::vector<EnvStatus> status(1);
  EXPECT_THAT(error_message([&] {
                solver.solve(solver.plan(one.view()), other.view(), {room.data(), room.data(), nullptr, status.data()});
              }),
              HasSubstr("make a new plan"));
  EXPECT_THAT(error_message([&] {
                solver.solve(solver.plan(one.view()), one.view(), {room.data(), nullptr, nullptr, status.data()});
              }),
              HasSubstr("solution.twist is null"));
  EXPECT_THAT(error_message([&] { solver.solve(one.view(), {room.data(), nullptr, nullptr, status.data()}); }),
              HasSubstr("solution.twist is null"));
}

/// A call that plans for itself gives the result of one with a plan, and refuses what plan() or solve() would.
TEST(BodiesInputs, APlanOfTheCallsOwnChangesNothing) {
  const auto batch = batch_of<double>({random_bodies(1, 5, 20), random_bodies(2, 7, 31), random_bodies(1, 5, 20)});
  for (const InvalidPolicy policy : {InvalidPolicy::reject, InvalidPolicy::isolate}) {
    BodySolverOptions options;
    options.iterations = 30;
    options.invalid = policy;
    const BodySolver solver(Device::cpu(), {}, options);
    const auto room = [&] {
      return BodySolution<double>{std::vector<double>(static_cast<std::size_t>(3 * batch.contact_count()), 77.0),
                                  std::vector<double>(static_cast<std::size_t>(6 * batch.body_count()), 77.0),
                                  std::vector<double>(static_cast<std::size_t>(3 * batch.contact_count()), 77.0),
                                  std::vector<EnvStatus>(static_cast<std::size_t>(batch.env_count()))};
    };
    const auto view_of = [](BodySolution<double>& s) {
      return BodySolutionView<double>{s.impulse.data(), s.twist.data(), s.w.data(), s.status.data()};
    };
    auto planned = room(), unplanned = room(), untouched = room();
    const auto view = batch.view();
    solver.solve(solver.plan(view), view, view_of(planned));
    solver.solve(view, view_of(unplanned));
    EXPECT_EQ(unplanned.impulse, planned.impulse);
    EXPECT_EQ(unplanned.twist, planned.twist);
    EXPECT_EQ(unplanned.w, planned.w);
    for (std::size_t e = 0; e < planned.status.size(); ++e) {
      EXPECT_EQ(unplanned.status[e].iterations, planned.status[e].iterations);
      EXPECT_EQ(unplanned.status[e].code, planned.status[e].code);
    }

    auto broken = view;
    std::vector<Index> sides(view.body_b, view.body_b + view.contact_count);
    sides[3] = 99;
    broken.body_b = sides.data();
    EXPECT_THAT(error_message([&] { solver.solve(broken, view_of(untouched)); }),
                ::testing::HasSubstr("body_b[env 0, contact 3] = 99"));
    EXPECT_EQ(untouched.impulse, room().impulse);
    EXPECT_EQ(untouched.twist, room().twist);
  }
}

/// Found by fuzz_solve: each sub-step's impulses were finite in single precision, and their sum was not.
TEST(BodiesInputs, ImpulsesOfSubStepsThatAddUpToInfinityAreTheLargestNumber) {
  const float most = std::numeric_limits<float>::max();
  BodyEnvironment<float> env;
  env.bodies.resize(1);
  env.bodies[0].inv_mass = 0.1F;
  env.bodies[0].twist = {7.9375F, 7.9375F, 7.9375F, 7.9375F, 7.9375F, -6.9375F};
  env.bodies[0].twist_change = {0.496094F, 0.496094F, 0.496094F, -most, 0.496094F, 0.496094F};
  const auto touch = [&](float normal, std::array<float, 3> arm, float mu, float depth) {
    env.contacts.push_back({.body_a = -1,
                            .body_b = 0,
                            .arm_a = {0.992188F, 0.992188F, 0.992188F},
                            .arm_b = arm,
                            .normal = {normal, 0, 0},
                            .mu = mu,
                            .depth = depth,
                            .restitution = 1});
  };
  touch(1, {0.90625F, 0.90625F, 0.90625F}, most, 0.124023F);
  touch(-1, {0.992188F, 0.992188F, 0.992188F}, 1, 0.124023F);
  touch(-1, {0.992188F, -0.976562F, -0.976562F}, 0.0117647F, -0.12207F);
  BodySolverOptions options;
  options.method = BodyMethod::newton;
  options.space.preconditioner = BodyPreconditioner::multigrid;
  options.iterations = 11;
  options.tolerance = 1e-6;
  options.omega = 1.5;
  options.substeps = 3;
  options.law = Law::convex;
  const auto solution = solve_bodies(batch_of<float>({env}), {}, options);
  EXPECT_NE(solution.status[0].code, EnvCode::solved);
  for (const float impulse : solution.impulse) EXPECT_TRUE(std::isfinite(impulse)) << impulse;
  EXPECT_EQ(*std::max_element(solution.impulse.begin(), solution.impulse.end()), most);
}

}  // namespace stiction::test
