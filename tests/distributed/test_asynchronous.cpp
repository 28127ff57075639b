// Consensus whose ranks do not wait for one another's rounds: its answers, the age of letters, and how it ends.
// Ranks have clocks of their own, so that the test decides which are late; once they are threads that run as they
// like.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <span>
#include <thread>

#include "distributed/solve/partition.hpp"
#include "distributed/subdomains/round_letters.hpp"
#include "distributed/subdomains/solve_by_consensus.hpp"
#include "distributed/transport/thread_transport.hpp"
#include "tests/distributed/rank_cases.hpp"

namespace stiction::distributed {
namespace {

Case until(double tolerance, double cfm = 0) {
  Case how = sweeps(100000, tolerance);
  how.options.law = Law::convex;
  how.stepping.cfm = cfm;
  return how;
}

ConsensusOptions into(int subdomains) {
  ConsensusOptions consensus;
  consensus.subdomains = subdomains;
  consensus.asynchronous = true;
  return consensus;
}

struct Ran {
  BodySolution<double> solution;
  std::vector<RankReport> ranks;
  double seconds = 0;  ///< by the latest clock
};

std::vector<int> parts_of(const BodyBatch<double>& batch, int subdomains) {
  return bisect(centres_by_arms(batch.view()), subdomains);
}

/// As many ranks as there are lengths of a round [s].
Ran on_clocks(const BodyBatch<double>& batch, ConsensusOptions consensus, const Case& how,
              const std::vector<double>& round, double latency = 0.1) {
  Ran ran{room_for(batch.view()), {}, 0};
  const std::vector<int> part = parts_of(batch, consensus.subdomains);
  std::vector<double> clocks(round.size());
  run_clocked_ranks(static_cast<int>(round.size()), 60, latency, [&](ClockedTransport& transport) {
    ConsensusOptions own = consensus;
    const auto rank = static_cast<std::size_t>(transport.rank());
    own.after_sweeps = [&] { transport.advance(round[rank]); };
    const auto all = solve_by_consensus(transport, batch.view(), std::span<const int>(part), own, how.stepping,
                                        how.options, rank == 0 ? view_of(ran.solution) : BodySolutionView<double>{});
    if (rank == 0) ran.ranks = all;
    clocks[rank] = transport.seconds();
  });
  ran.seconds = *std::max_element(clocks.begin(), clocks.end());
  return ran;
}

TEST(Asynchronous, AnIndependentJudgeFindsItsResidualWhoeverIsLate) {
  for (const bool is_pile : {false, true}) {
    const BodyEnvironment<double> env = is_pile ? scenes::make_body_pile(5, 60) : small_wall();
    const BodyBatch<double> batch = batch_of(env);
    const Case how = until(1e-4, 1e-3);
    for (const std::vector<double>& round :
         std::vector<std::vector<double>>{{1}, {1, 1}, {1, 7.3}, {9.1, 1, 1.7}, {1, 30, 1, 1}}) {
      const Ran ran = on_clocks(batch, into(4), how, round);
      const EnvStatus& status = ran.solution.status[0];
      SCOPED_TRACE(std::to_string(round.size()) + " ranks, sweeps " + std::to_string(status.iterations) +
                   ", residual " + std::to_string(status.residual));
      EXPECT_EQ(status.code, EnvCode::solved);
      EXPECT_LE(verified(env, how, ran.solution), 1.001e-4);
      EXPECT_NEAR(verified(env, how, ran.solution), status.residual, 1e-11);
    }
  }
}

TEST(Asynchronous, ItsTwistsAreThoseOfSweeps) {
  const BodyBatch<double> batch = batch_of(small_wall());
  const Case how = until(1e-7, 1e-3);
  const BodySolution<double> one = by_one_process(batch, how);
  ASSERT_EQ(one.status[0].code, EnvCode::solved);
  const BodySolution<double> many = on_clocks(batch, into(4), how, {1, 5.2, 1.1, 1}).solution;
  ASSERT_EQ(many.status[0].code, EnvCode::solved);
  // Twists of a convex problem are unique; b is of size 1, and R bounds the error that 1e-7 of it can hide.
  EXPECT_LT(largest_difference(many.twist, one.twist), 1e-5);
}

TEST(Asynchronous, ThreadsThatRunAsTheyLike) {
  const BodyEnvironment<double> env = small_wall();
  const BodyBatch<double> batch = batch_of(env);
  const Case how = until(1e-4, 1e-3);
  const std::vector<int> part = parts_of(batch, 4);
  for (const int ranks : {2, 3, 6}) {  // with 6 two have nothing to do
    BodySolution<double> solution = room_for(batch.view());
    run_thread_ranks(ranks, 60, [&](Transport& transport) {
      solve_by_consensus(transport, batch.view(), std::span<const int>(part), into(4), how.stepping, how.options,
                         transport.rank() == 0 ? view_of(solution) : BodySolutionView<double>{});
    });
    SCOPED_TRACE(std::to_string(ranks) + " ranks");
    EXPECT_EQ(solution.status[0].code, EnvCode::solved);
    EXPECT_LE(verified(env, how, solution), 1.001e-4);
  }
}

/// Between two meetings the slow rank makes four rounds, and a fast one sixty-four at most.
TEST(Asynchronous, AFastRankGoesOnButNotForEver) {
  const BodyBatch<double> batch = batch_of(small_wall());
  for (const double slow : {4.0, 100.0}) {
    const Ran ran = on_clocks(batch, into(4), until(1e-4, 1e-3), {1, 1, slow, 1});
    const double lead = static_cast<double>(ran.ranks[0].rounds) / static_cast<double>(ran.ranks[2].rounds);
    EXPECT_EQ(ran.ranks[2].rounds % 4, 0);
    EXPECT_GT(lead, slow == 4 ? 3.5 : 15);
    EXPECT_LE(lead, slow == 4 ? 5.5 : 16);
    // The late rank does not wait: its clock has its rounds, and some latencies of each meeting.
    EXPECT_LT(ran.seconds, static_cast<double>(ran.ranks[2].rounds) * (slow + 0.5));
  }
}

/// A clocked run follows from its clocks; another clock is another run.
TEST(Asynchronous, BitsFollowWhoIsLate) {
  const BodyBatch<double> batch = batch_of(wall());
  const Case how = until(1e-3);
  const BodySolution<double> one = on_clocks(batch, into(4), how, {1, 3.1, 1, 1}).solution;
  expect_same(on_clocks(batch, into(4), how, {1, 3.1, 1, 1}).solution, one);
  EXPECT_NE(on_clocks(batch, into(4), how, {1, 1, 3.1, 1}).solution.impulse, one.impulse);
}

/// Sweeps that are too few are not called an answer, and no rank makes more.
TEST(Asynchronous, WhatIsNotSolvedIsNotCalledSo) {
  const BodyEnvironment<double> env = wall();
  const BodyBatch<double> batch = batch_of(env);
  Case how = until(1e-12);
  how.options.iterations = 777;
  const Ran ran = on_clocks(batch, into(4), how, {1, 2.6, 1, 1});
  EXPECT_EQ(ran.solution.status[0].code, EnvCode::max_iterations);
  EXPECT_NEAR(verified(env, how, ran.solution), ran.solution.status[0].residual, 1e-9);
  for (const RankReport& rank : ran.ranks) EXPECT_LE(16 * rank.rounds, 777);
  EXPECT_EQ(ran.solution.status[0].iterations, 16 * ran.ranks[0].rounds);
}

TEST(Asynchronous, SeveralEnvironmentsEmptyAndBrokenOnes) {
  BodyBatch<double> batch;
  batch.add({});
  batch.add(small_wall());
  BodyEnvironment<double> broken = small_wall();
  broken.contacts[2].depth = std::numeric_limits<double>::quiet_NaN();
  batch.add(broken);
  batch.add(small_wall());
  Case how = until(1e-3);
  how.options.invalid = InvalidPolicy::isolate;
  const Ran ran = on_clocks(batch, into(3), how, {1, 4.1, 1});
  EXPECT_EQ(ran.solution.status[0].code, EnvCode::solved);
  EXPECT_EQ(ran.solution.status[1].code, EnvCode::solved);
  EXPECT_EQ(ran.solution.status[2].code, EnvCode::invalid_input);
  EXPECT_EQ(ran.solution.status[3].code, EnvCode::solved);
}

/// Row 0 is a rank's own, row 1 the other's. The newest letter stays, and a letter from before all met is dropped.
TEST(Asynchronous, LettersCarryTheNewestRows) {
  run_thread_ranks(2, 60, [](Transport& transport) {
    const std::vector<Neighbour> neighbours{{1 - transport.rank(), {0}, {1}}};
    RoundLetters letters(transport, neighbours);
    const double mine = 10.0 * (transport.rank() + 1);
    std::vector<double> rows(12, 0.0);
    letters.begin();
    for (Index made = 1; made <= 4; ++made) {
      rows[5] = mine + made;
      letters.send(made, rows.data());
    }
    while (!letters.all_are_ready()) letters.await(rows.data());
    EXPECT_EQ(rows[11], 30 - mine + 4);
    EXPECT_EQ(rows[5], mine + 4);
    letters.send(5, rows.data());
    letters.begin();
    EXPECT_FALSE(letters.all_are_ready());
    rows[11] = -1;
    letters.send(1, rows.data());
    letters.await(rows.data());
    EXPECT_EQ(rows[11], -1);
    letters.finish();
  });
}

/// A silent rank is waited for once another one has made all the rounds it may.
TEST(Asynchronous, ARankThatIsSilentEndsTheJob) {
  const BodyBatch<double> batch = batch_of(small_wall());
  const std::vector<int> part = parts_of(batch, 2);
  const std::string message = message_of([&] {
    run_thread_ranks(2, 0.3, [&](Transport& transport) {
      BodySolution<double> solution = room_for(batch.view());
      ConsensusOptions own = into(2);
      if (transport.rank() == 1) own.after_sweeps = [] { std::this_thread::sleep_for(std::chrono::seconds(1)); };
      const Case how = until(0);
      solve_by_consensus(transport, batch.view(), std::span<const int>(part), own, how.stepping, how.options,
                         view_of(solution));
    });
  });
  EXPECT_THAT(message, ::testing::HasSubstr("rank 0: rank 1 has not answered within the deadline"));
}

TEST(Asynchronous, OtherLawsAreRefused) {
  using ::testing::AllOf;
  using ::testing::HasSubstr;
  const BodyBatch<double> batch = batch_of(small_wall());
  Case how = until(1e-3);
  how.options.law = Law::coulomb;
  const auto refusal = [&] { return message_of([&] { on_clocks(batch, into(2), how, {1, 1}); }); };
  EXPECT_THAT(refusal(), AllOf(HasSubstr("asynchronous"), HasSubstr("Coulomb's law"), HasSubstr("--law convex")));
  how.options.law = Law::convex;
  how.options.box_friction = true;
  EXPECT_THAT(refusal(), AllOf(HasSubstr("asynchronous"), HasSubstr("boxed friction"), HasSubstr("--law convex")));
}

}  // namespace
}  // namespace stiction::distributed
