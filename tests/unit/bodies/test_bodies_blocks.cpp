// Blocks of contacts in sequential impulses. They are held against sweeps of pgs in blocks on A of the same bodies, and
// against a judge of another kind.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "core/job/body_job.hpp"
#include "scenes/body_scenes.hpp"
#include "scenes/box_scenes.hpp"
#include "stiction/residual.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/error_message.hpp"
#include "tests/support/oracles/box_friction_oracle.hpp"
#include "tests/support/systems/body_systems.hpp"
#include "tests/support/systems/boxed.hpp"
#include "tests/support/systems/small_systems.hpp"

namespace stiction::test {
namespace {

using Env = BodyEnvironment<double>;

BodySolverOptions in_pairs(Law law, double tolerance, Index iterations, bool momentum = true) {
  BodySolverOptions options;
  options.box_friction = law == kBoxFriction;
  if (!options.box_friction) options.law = law;
  options.blocks = BlockMode::pairs;
  options.momentum = momentum;
  options.tolerance = tolerance;
  options.iterations = iterations;
  options.threads = 1;
  return options;
}

BodySolution<double> solve_one(const Env& env, const BodySolverOptions& options, const TimeStepping& stepping = {}) {
  return solve_bodies(batch_of<double>({env}), stepping, options);
}

BodySolverOptions in_cones(BodySolverOptions options) {
  options.blocks = BlockMode::cones;
  return options;
}

/// Two boxes on a floor. Contacts between the boxes come first, as they do in sweeps of either kind.
Env two_boxes() {
  Env env = scenes::make_body_stack(4, 2);
  EXPECT_EQ(env.contacts.size(), 8U);
  std::rotate(env.contacts.begin(), env.contacts.begin() + 4, env.contacts.end());
  return env;
}

/// Makes bodies a contact system, in which each pair of bodies is a group.
ContactBatch<double> grouped(const Env& env, const TimeStepping& stepping, Law law) {
  Environment<double> system = scenes::delassus_form(env, stepping);
  for (std::size_t c = 0; c < system.cones.size(); ++c) system.cones[c].group = static_cast<Index>(c) / 4;
  return batch_of({system}, law);
}

// Both are one iteration, and their first sweeps differ by roundings. Single cones differ by more than a thousandth of
// the largest impulse.
TEST(BodiesBlocks, FirstSweepsAreThoseOfPgsInBlocksOnTheMatrix) {
  TimeStepping stepping;
  stepping.cfm = 1e-4;
  for (const Law law : {Law::coulomb, Law::convex})
    for (const Index sweeps : {1, 2, 5}) {
      SCOPED_TRACE(std::string(to_string(law)) + ", " + std::to_string(sweeps) + " sweeps");
      const Env env = two_boxes();
      const BodySolverOptions options = in_pairs(law, 0, sweeps, false);
      const auto solution = solve_one(env, options, stepping);
      SolverOptions by_matrix = test::options(SolverKind::pgs, 0, sweeps);
      by_matrix.blocks = BlockMode::pairs;
      const auto expected = solve(grouped(env, stepping, law), by_matrix);
      const auto single = solve_one(env, in_cones(options), stepping);
      double largest = 0, off = 0, otherwise = 0;
      for (std::size_t i = 0; i < expected.lambda.size(); ++i) {
        largest = std::max(largest, std::abs(expected.lambda[i]));
        off = std::max(off, std::abs(solution.impulse[i] - expected.lambda[i]));
        otherwise = std::max(otherwise, std::abs(single.impulse[i] - expected.lambda[i]));
      }
      EXPECT_LE(off, 1e-12 * largest);
      EXPECT_GE(otherwise, 1e-3 * largest);
    }
}

TEST(BodiesBlocks, AContactThatIsAloneIsVisitedOnce) {
  Env env = scenes::make_body_pile(3, 60);
  const auto is_of_one_pair = [](const auto& one, const auto& other) {
    return one.body_a == other.body_a && one.body_b == other.body_b;
  };
  env.contacts.erase(std::unique(env.contacts.begin(), env.contacts.end(), is_of_one_pair), env.contacts.end());
  ASSERT_GT(env.contacts.size(), 40U);
  for (const Law law : {Law::coulomb, Law::convex, kBoxFriction}) {
    const BodySolverOptions options = in_pairs(law, 0, 20);
    const auto blocks = solve_one(env, options), single = solve_one(env, in_cones(options));
    EXPECT_TRUE(same_bits(std::span<const double>(single.impulse), std::span<const double>(blocks.impulse)));
  }
  // Two contacts of one pair are a block.
  env.contacts.push_back(env.contacts.back());
  env.contacts.back().arm_b[0] += 0.01;
  const BodySolverOptions options = in_pairs(Law::coulomb, 0, 20);
  EXPECT_NE(solve_one(env, options).impulse, solve_one(env, in_cones(options)).impulse);
}

/// The largest difference of two motions.
double apart(const std::vector<double>& a, const std::vector<double>& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, std::abs(a[i] - b[i]));
  return largest;
}

TEST(BodiesBlocks, AnswersHoldBeforeAJudgeAndHaveTheMotionOfSingleContacts) {
  TimeStepping stepping;
  stepping.cfm = 1e-4;
  for (const Env& env :
       {scenes::make_body_stack(5, 4), scenes::box_bodies(scenes::box_wall(3, 3), 0.5), random_bodies(9, 12, 30)})
    for (const Law law : {Law::coulomb, Law::convex, kBoxFriction})
      for (const bool momentum : {false, true}) {
        SCOPED_TRACE(std::to_string(env.contacts.size()) + " contacts, law " + std::to_string(static_cast<int>(law)) +
                     (momentum ? ", momentum" : ""));
        const BodySolverOptions options = in_pairs(law, 1e-10, 200000, momentum);
        const auto solution = solve_one(env, options, stepping), single = solve_one(env, in_cones(options), stepping);
        ASSERT_EQ(solution.status[0].code, EnvCode::solved);
        ASSERT_EQ(single.status[0].code, EnvCode::solved);
        EXPECT_LT(apart(solution.w, single.w), 1e-6);
        const Environment<double> system = scenes::delassus_form(env, stepping);
        if (law == kBoxFriction) {
          EXPECT_LT(oracle::box_friction_violation(boxed(system), solution.impulse), 1e-8);
        } else {
          const ContactBatch<double> batch = batch_of({system}, law);
          EXPECT_LE(verify(batch.view(), std::span<const double>(solution.impulse)).at(0).relative, 1.1e-10);
        }
      }
}

TEST(BodiesBlocks, OnAFewBoxesTheySaveSweeps) {
  for (const Index boxes : {3, 5}) {
    const Env env = scenes::make_body_stack(7, boxes);
    const BodySolverOptions options = in_pairs(Law::coulomb, 1e-6, 100000, false);
    const Index blocks = solve_one(env, options).status[0].iterations;
    EXPECT_LT(blocks, solve_one(env, in_cones(options)).status[0].iterations) << boxes;
  }
}

TEST(BodiesBlocks, WhatHasNoneRefusesThemByName) {
  const auto refused = [](BlockMode blocks, BodyMethod method) {
    BodySolverOptions options;
    options.blocks = blocks;
    options.method = method;
    return error_message([&] { const BodySolver solver(Device::cpu(), {}, options); });
  };
  EXPECT_THAT(refused(BlockMode::pairs, BodyMethod::newton), testing::HasSubstr("method = newton"));
  EXPECT_THAT(refused(BlockMode::strong, BodyMethod::impulses), testing::HasSubstr("choose pairs"));
  EXPECT_THAT(refused(static_cast<BlockMode>(9), BodyMethod::impulses), testing::HasSubstr("blocks = 9"));
  EXPECT_EQ(refused(BlockMode::pairs, BodyMethod::impulses), "");
}

}  // namespace
}  // namespace stiction::test
