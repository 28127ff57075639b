// The bits of one process, for any number of ranks and any owners.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <span>

#include "distributed/solve/partition.hpp"
#include "distributed/solve/solve_over_ranks.hpp"
#include "distributed/transport/thread_transport.hpp"
#include "scenes/body_scenes.hpp"
#include "scenes/box_scenes.hpp"
#include "tests/distributed/rank_cases.hpp"

namespace stiction::distributed {
namespace {

template <class Real>
BodySolution<Real> by_ranks(const BodyBatch<Real>& batch, int ranks, const std::vector<int>& owner, const Case& how,
                            const std::vector<Real>& start = {}, std::vector<RankReport>* report = nullptr) {
  BodySolution<Real> solution = room_for(batch.view());
  run_thread_ranks(ranks, 60, [&](Transport& transport) {
    BodySolution<Real> other = room_for(batch.view());
    const bool is_first = transport.rank() == 0;
    const auto all = solve_over_ranks(transport, batch.view(), std::span<const int>(owner), how.stepping, how.options,
                                      view_of(is_first ? solution : other), start.empty() ? nullptr : start.data());
    if (is_first && report != nullptr) *report = all;
  });
  return solution;
}

/// Every number of ranks up to 4, owners by bisection and drawn at random.
template <class Real>
void expect_one_answer(const BodyBatch<Real>& batch, const Case& how, const std::vector<Real>& start = {}) {
  const BodySolution<Real> one = by_one_process(batch, how, start);
  const std::vector<Point> centres = centres_by_arms(batch.view());
  for (int ranks = 1; ranks <= 4; ++ranks) {
    SCOPED_TRACE(std::to_string(ranks) + " ranks");
    expect_same(by_ranks(batch, ranks, bisect(centres, ranks), how, start), one);
    for (std::uint64_t seed = 0; seed < 3; ++seed)
      expect_same(by_ranks(batch, ranks, random_owners(batch.body_count(), ranks, seed), how, start), one);
  }
}

TEST(Ranks, AWallHasTheBitsOfOneProcess) {
  expect_one_answer(batch_of(wall()), sweeps(100));
  expect_one_answer(single_of(wall()), sweeps(100));
}

TEST(Ranks, APyramidAndAPile) {
  expect_one_answer(batch_of(scenes::box_bodies(scenes::box_pyramid(4), 0.4)), sweeps(70));
  expect_one_answer(batch_of(scenes::make_body_pile(5, 300)), sweeps(50));
}

TEST(Ranks, AFloorThatMovesIsEverybodysNeighbour) {
  expect_one_answer(batch_of(scenes::make_body_stack(3, 9)), sweeps(60));
}

TEST(Ranks, ConvexLawWithoutMomentumRelaxed) {
  Case how = sweeps(60);
  how.options.law = Law::convex;
  how.options.momentum = false;
  how.options.omega = 1.3;
  how.stepping.cfm = 1e-4;
  expect_one_answer(batch_of(wall()), how);
}

TEST(Ranks, ContactsInPairs) {
  Case how = sweeps(60);
  how.options.blocks = BlockMode::pairs;
  expect_one_answer(batch_of(wall()), how);
}

TEST(Ranks, BoxedFriction) {
  Case how = sweeps(60);
  how.options.box_friction = true;
  expect_one_answer(batch_of(wall()), how);
  expect_one_answer(single_of(scenes::make_body_pile(5, 300)), how);
}

TEST(Ranks, StopAtTheSameSweep) {
  const BodyBatch<double> batch = batch_of(wall());
  const Case how = sweeps(5000, 1e-4);
  const BodySolution<double> one = by_one_process(batch, how);
  ASSERT_EQ(one.status[0].code, EnvCode::solved);
  ASSERT_GT(one.status[0].iterations, 16);
  ASSERT_LT(one.status[0].iterations, 5000);
  expect_one_answer(batch, how);
}

TEST(Ranks, Substeps) {
  Case how = sweeps(20);
  how.options.substeps = 3;
  expect_one_answer(batch_of(wall()), how);
}

TEST(Ranks, AWarmStart) {
  const BodyBatch<double> batch = batch_of(wall());
  std::vector<double> start = by_one_process(batch, sweeps(200)).impulse;
  start[4] += 0.01;
  expect_one_answer(batch, sweeps(48), start);
  start[7] = std::numeric_limits<double>::quiet_NaN();
  expect_one_answer(batch, sweeps(48), start);
}

TEST(Ranks, SeveralEnvironmentsAndEmptyOnes) {
  expect_one_answer(mixed_environments(), sweeps(40, 1e-8));
}

TEST(Ranks, MoreRanksThanBodies) {
  const BodyBatch<double> batch = batch_of(scenes::box_bodies(scenes::box_tower(3), 0.5));
  const BodySolution<double> one = by_one_process(batch, sweeps(30));
  expect_same(by_ranks(batch, 7, bisect(centres_by_arms(batch.view()), 7), sweeps(30)), one);
  expect_same(by_ranks(batch, 7, {6, 6, 2}, sweeps(30)), one);
}

TEST(Ranks, BrokenNumbersAreFlaggedByAll) {
  Case how = sweeps(30);
  how.options.invalid = InvalidPolicy::isolate;
  BodyEnvironment<double> broken = wall();
  broken.contacts[20].depth = std::numeric_limits<double>::infinity();
  expect_one_answer(batch_of(broken), how);
  broken = wall();
  broken.contacts[20].mu = -1;
  expect_one_answer(batch_of(broken), how);
  // Numbers that are sound and overflow: no iterate is finite.
  broken = wall();
  for (auto& body : broken.bodies) body.twist[2] = -1e300;
  broken.bodies[0].twist[2] = 1e308;
  broken.bodies[8].twist[2] = -1.7e308;
  expect_one_answer(batch_of(broken), how);
}

TEST(Ranks, NothingMoves) {
  BodyEnvironment<double> still = wall();
  for (auto& body : still.bodies) body.twist = body.twist_change = {};
  expect_one_answer(batch_of(still), sweeps(30, 1e-6), std::vector<double>(3 * still.contacts.size(), 0.5));
}

/// Random graphs: any body may touch any other, colours are many, and ghosts are late.
TEST(Ranks, AnythingTouchesAnything) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    std::uint64_t state = seed;
    const auto draw = [&state](std::uint64_t count) {
      state = state * 6364136223846793005ULL + 1442695040888963407ULL;
      return (state >> 33U) % count;
    };
    BodyEnvironment<double> env;
    env.bodies.resize(12);
    for (auto& body : env.bodies) {
      for (double& number : body.twist) number = static_cast<double>(draw(200)) / 100 - 1;
      body.inv_mass = 0.5 + static_cast<double>(draw(100)) / 50;
      body.kinematic = draw(8) == 0;
    }
    for (int c = 0; c < 60; ++c) {
      auto& contact = env.contacts.emplace_back();
      contact.body_a = static_cast<Index>(draw(13)) - 1;
      contact.body_b = static_cast<Index>(draw(12));
      if (contact.body_a == contact.body_b) contact.body_a = -1;
      for (double& number : contact.arm_a) number = static_cast<double>(draw(200)) / 100 - 1;
      for (double& number : contact.arm_b) number = static_cast<double>(draw(200)) / 100 - 1;
      contact.mu = 0.4;
    }
    Case how = sweeps(40);
    how.stepping.cfm = 1e-3;  // contacts between kinematic bodies have a diagonal
    expect_one_answer(batch_of(env), how);
  }
}

TEST(Ranks, WhatIsSentFollowsTheOwners) {
  const BodyBatch<double> batch = batch_of(wall());
  const Case how = sweeps(64);
  std::vector<RankReport> report;
  by_ranks(batch, 1, std::vector<int>(42, 0), how, {}, &report);
  ASSERT_EQ(report.size(), 1U);
  EXPECT_EQ(report[0].messages, 0);
  EXPECT_EQ(report[0].bytes, 0);
  EXPECT_EQ(report[0].ghosts, 0);
  EXPECT_EQ(report[0].bodies, 42);
  by_ranks(batch, 2, bisect(centres_by_arms(batch.view()), 2), how, {}, &report);
  ASSERT_EQ(report.size(), 2U);
  std::int64_t bisected = 0, owned = 0;
  for (const RankReport& rank : report) {
    EXPECT_GT(rank.messages, 0);
    bisected += rank.bytes;
    owned += rank.bodies - rank.ghosts;
    // 64 sweeps have one exchange before each of the colours at most, and one after. Two arrays are refreshed at the
    // start and after each 16 sweeps. The last exchange is of exact twists.
    const Index colors = BodySolver(Device::cpu(), how.stepping, how.options).plan(batch.view()).color_count(0);
    EXPECT_LE(rank.exchanges, 64 * (colors + 1) + 5 * 2 + 1);
    EXPECT_GE(rank.exchanges, 64);
  }
  EXPECT_EQ(owned, 42);
  std::int64_t scattered = 0;
  by_ranks(batch, 2, random_owners(42, 2, 1), how, {}, &report);
  for (const RankReport& rank : report) scattered += rank.bytes;
  EXPECT_LT(bisected, scattered) << "bisection cuts fewer contacts";
}

TEST(Ranks, RefusesWhatItCannotDo) {
  using ::testing::HasSubstr;
  const BodyBatch<double> batch = batch_of(wall());
  const std::vector<int> owner(42, 0);
  Case how = sweeps(5);
  EXPECT_THAT(message_of([&] { by_ranks(batch, 2, std::vector<int>(41, 0), how); }),
              HasSubstr("owner has 41 elements"));
  std::vector<int> wrong = owner;
  wrong[5] = 2;
  EXPECT_THAT(message_of([&] { by_ranks(batch, 2, wrong, how); }), HasSubstr("owner[5] = 2: expected a rank in 0..1"));
  how.options.method = BodyMethod::newton;
  EXPECT_THAT(message_of([&] { by_ranks(batch, 2, owner, how); }), HasSubstr("method"));
  how = sweeps(5);
  how.options.max_contacts_per_env = 3;
  EXPECT_THAT(message_of([&] { by_ranks(batch, 2, owner, how); }), HasSubstr("max_contacts_per_env = 3"));
  how = sweeps(-1);
  EXPECT_THAT(message_of([&] { by_ranks(batch, 2, owner, how); }), HasSubstr("iterations = -1"));
}

TEST(Ranks, NoticeThatTheyWereGivenDifferentBatches) {
  const BodyBatch<double> batch = batch_of(wall());
  BodyEnvironment<double> other_env = wall();
  other_env.bodies[9].twist[1] = 1e-12;
  const BodyBatch<double> other = batch_of(other_env);
  const std::vector<int> owner = random_owners(42, 3, 1);
  EXPECT_THAT(message_of([&] {
                run_thread_ranks(3, 60, [&](Transport& transport) {
                  const BodyBatch<double>& own = transport.rank() == 2 ? other : batch;
                  BodySolution<double> solution = room_for(own.view());
                  solve_over_ranks(transport, own.view(), std::span<const int>(owner), {}, {}, view_of(solution));
                });
              }),
              ::testing::HasSubstr("rank 2 has another batch"));
}

}  // namespace
}  // namespace stiction::distributed
