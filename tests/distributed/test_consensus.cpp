// Consensus between subdomains: its answers, and that its bits follow the number of subdomains and no other.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <numeric>
#include <span>

#include "distributed/solve/partition.hpp"
#include "distributed/subdomains/solve_by_consensus.hpp"
#include "distributed/subdomains/subdomains.hpp"
#include "distributed/transport/thread_transport.hpp"
#include "tests/distributed/rank_cases.hpp"

namespace stiction::distributed {
namespace {

/// Bodies halved until there are that many parts.
template <class Real>
std::vector<int> parts_of(const BodyBatch<Real>& batch, int subdomains) {
  return bisect(centres_by_arms(batch.view()), subdomains);
}

template <class Real>
BodySolution<Real> by_consensus(const BodyBatch<Real>& batch, int ranks, const std::vector<int>& part,
                                const ConsensusOptions& consensus, const Case& how, const std::vector<Real>& start = {},
                                std::vector<RankReport>* report = nullptr) {
  BodySolution<Real> solution = room_for(batch.view());
  run_thread_ranks(ranks, 60, [&](Transport& transport) {
    const bool is_first = transport.rank() == 0;
    const auto all = solve_by_consensus(transport, batch.view(), std::span<const int>(part), consensus, how.stepping,
                                        how.options, is_first ? view_of(solution) : BodySolutionView<Real>{},
                                        start.empty() ? nullptr : start.data());
    if (is_first && report != nullptr) *report = all;
  });
  return solution;
}

ConsensusOptions into(int subdomains) {
  ConsensusOptions consensus;
  consensus.subdomains = subdomains;
  return consensus;
}

Case until(double tolerance, Law law) {
  Case how = sweeps(60000, tolerance);
  how.options.law = law;
  return how;
}

TEST(Consensus, AnIndependentJudgeFindsItsResidual) {
  for (const Law law : {Law::convex, Law::coulomb})
    for (const bool is_pile : {false, true}) {
      const BodyEnvironment<double> env = is_pile ? scenes::make_body_pile(5, 60) : small_wall();
      Case how = until(1e-6, law);
      how.stepping.cfm = is_pile ? 1e-3 : 0;
      const BodyBatch<double> batch = batch_of(env);
      const BodySolution<double> solution = by_consensus(batch, 2, parts_of(batch, 3), into(3), how);
      SCOPED_TRACE(std::string(to_string(law)) + ", sweeps " + std::to_string(solution.status[0].iterations) +
                   ", residual " + std::to_string(solution.status[0].residual));
      EXPECT_EQ(solution.status[0].code, EnvCode::solved);
      EXPECT_LE(verified(env, how, solution), 1.001e-6);
      EXPECT_NEAR(verified(env, how, solution), solution.status[0].residual, 1e-11);
    }
}

TEST(Consensus, UnderTheConvexLawItsTwistsAreThoseOfSweeps) {
  const BodyBatch<double> batch = batch_of(small_wall());
  Case how = until(1e-7, Law::convex);
  how.stepping.cfm = 1e-3;
  const BodySolution<double> one = by_one_process(batch, how);
  ASSERT_EQ(one.status[0].code, EnvCode::solved);
  for (const int subdomains : {1, 2, 4}) {
    const BodySolution<double> many = by_consensus(batch, 1, parts_of(batch, subdomains), into(subdomains), how);
    SCOPED_TRACE(subdomains);
    ASSERT_EQ(many.status[0].code, EnvCode::solved);
    // Twists of a convex problem are unique; b is of size 1, and R bounds the error that 1e-7 of it can hide.
    EXPECT_LT(largest_difference(many.twist, one.twist), 1e-5);
  }
}

/// A solver returns its first guess if that is the best it has seen, and so would every round.
TEST(Consensus, RoundsThatChangeNothingGrow) {
  const BodyBatch<double> batch = batch_of(small_wall());
  Case how = until(1e-8, Law::convex);
  how.stepping.cfm = 1e-4;
  EXPECT_EQ(by_consensus(batch, 1, parts_of(batch, 1), into(1), how).status[0].code, EnvCode::solved);
  how.options.iterations = 1000;
  EXPECT_LE(by_consensus(batch, 1, parts_of(batch, 1), into(1), how).status[0].iterations, 1000);
}

/// 1 to 4 ranks, and more ranks than subdomains.
template <class Real>
void expect_one_answer(const BodyBatch<Real>& batch, const std::vector<int>& part, const ConsensusOptions& consensus,
                       const Case& how, const std::vector<Real>& start = {}) {
  const BodySolution<Real> one = by_consensus(batch, 1, part, consensus, how, start);
  for (const int ranks : {2, 3, 4, 7}) {
    SCOPED_TRACE(std::to_string(ranks) + " ranks");
    expect_same(by_consensus(batch, ranks, part, consensus, how, start), one);
  }
}

TEST(Consensus, RanksReachNoBit) {
  const BodyBatch<double> wide = batch_of(wall());
  expect_one_answer(wide, parts_of(wide, 5), into(5), sweeps(320));
  expect_one_answer(wide, random_owners(wide.body_count(), 6, 2), into(6), sweeps(320));
  const BodyBatch<float> narrow = single_of(wall());
  expect_one_answer(narrow, parts_of(narrow, 4), into(4), sweeps(320));
  const BodyBatch<double> pile = batch_of(scenes::make_body_pile(5, 300));
  Case how = sweeps(320, 1e-4);
  how.options.law = Law::convex;
  expect_one_answer(pile, parts_of(pile, 4), into(4), how);
  how.options.box_friction = true;
  expect_one_answer(pile, parts_of(pile, 4), into(4), how);
}

TEST(Consensus, SeveralEnvironmentsAndEmptyOnes) {
  const BodyBatch<double> batch = mixed_environments();
  const std::vector<int> part = parts_of(batch, 3);
  expect_one_answer(batch, part, into(3), sweeps(96));
  const BodySolution<double> solution = by_consensus(batch, 2, part, into(3), sweeps(96));
  EXPECT_EQ(solution.status[0].code, EnvCode::solved);
  EXPECT_EQ(solution.status[1].code, EnvCode::max_iterations);
  EXPECT_EQ(solution.status[1].iterations, 96);
  const BodySolution<double> one = by_one_process(batch, sweeps(96));
  for (Offset k = 6 * (0 + 42); k < 6 * (42 + 3); ++k)
    EXPECT_EQ(solution.twist[static_cast<std::size_t>(k)], one.twist[static_cast<std::size_t>(k)]);
}

TEST(Consensus, StartsFromReactions) {
  const BodyBatch<double> batch = batch_of(small_wall());
  const Case how = until(1e-5, Law::coulomb);
  std::vector<double> start = by_one_process(batch, until(1e-6, Law::coulomb)).impulse;
  EXPECT_EQ(by_consensus(batch, 2, parts_of(batch, 2), into(2), how, start).status[0].iterations, 0);
  expect_one_answer(batch, parts_of(batch, 2), into(2), sweeps(160), start);
  start[7] = std::numeric_limits<double>::quiet_NaN();
  const BodySolution<double> cold = by_consensus(batch, 2, parts_of(batch, 2), into(2), sweeps(64), start);
  EXPECT_EQ(cold.status[0].flags, kFlagWarmStartRejected);
  const BodySolution<double> none = by_consensus(batch, 2, parts_of(batch, 2), into(2), sweeps(64));
  EXPECT_TRUE(test::same_bits(std::span<const double>(cold.impulse), std::span<const double>(none.impulse)));
}

TEST(Consensus, BrokenNumbersAreFlaggedAndOthersAreNot) {
  Case how = sweeps(64);
  how.options.invalid = InvalidPolicy::isolate;
  BodyEnvironment<double> broken = wall();
  broken.contacts[20].depth = std::numeric_limits<double>::quiet_NaN();
  BodyBatch<double> batch;
  batch.add(wall());
  batch.add(broken);
  batch.add(wall());
  const std::vector<int> part = parts_of(batch, 3);
  expect_one_answer(batch, part, into(3), how);
  const BodySolution<double> solution = by_consensus(batch, 2, part, into(3), how);
  EXPECT_EQ(solution.status[1].code, EnvCode::invalid_input);
  EXPECT_EQ(solution.status[1].flags, kFlagNonFiniteInput);
  EXPECT_TRUE(std::isinf(solution.status[1].residual));
  for (Offset k = 6 * 42; k < 6 * 84; ++k) EXPECT_EQ(solution.twist[static_cast<std::size_t>(k)], 0);
  EXPECT_EQ(solution.status[0].code, EnvCode::max_iterations);
  EXPECT_EQ(solution.status[2].code, EnvCode::max_iterations);
  how.options.invalid = InvalidPolicy::reject;
  EXPECT_THAT(message_of([&] { by_consensus(batch, 2, part, into(3), how); }), ::testing::HasSubstr("depth"));
}

TEST(Consensus, NumbersThatOverflowEndInAFiniteAnswer) {
  BodyEnvironment<double> broken = wall();
  for (auto& body : broken.bodies) body.twist[2] = -1e300;
  broken.bodies[0].twist[2] = 1e308;
  broken.bodies[8].twist[2] = -1.7e308;
  const BodyBatch<double> batch = batch_of(broken);
  expect_one_answer(batch, parts_of(batch, 3), into(3), sweeps(160));
  const BodySolution<double> solution = by_consensus(batch, 2, parts_of(batch, 3), into(3), sweeps(160));
  EXPECT_NE(solution.status[0].code, EnvCode::solved);
  for (const double number : solution.impulse) EXPECT_TRUE(std::isfinite(number));
}

TEST(Consensus, OneExchangeARound) {
  const BodyBatch<double> batch = batch_of(wall());
  std::vector<RankReport> report;
  by_consensus(batch, 2, parts_of(batch, 4), into(4), sweeps(160), {}, &report);
  ASSERT_EQ(report.size(), 2U);
  // 10 rounds of 16 sweeps, and judgements before the first, after each fourth and after the last.
  for (const RankReport& rank : report) {
    EXPECT_EQ(rank.exchanges, 10 + 4);
    EXPECT_EQ(rank.messages, 10 + 4);
    EXPECT_EQ(rank.bytes % (14 * 6 * 8), 0);
  }
  by_consensus(batch, 1, parts_of(batch, 4), into(4), sweeps(160), {}, &report);
  EXPECT_EQ(report[0].exchanges, 0);
  EXPECT_EQ(report[0].bytes, 0);
}

TEST(Subdomains, HaveEachContactOnceAndACopyOfItsBodies) {
  const BodyBatch<double> batch = batch_of(wall());
  const BodyBatchView<double> view = batch.view();
  const std::vector<int> part = random_owners(batch.body_count(), 5, 3);
  const Subdomains parts = make_subdomains(view, std::span<const int>(part), 5);
  std::vector<int> seen(static_cast<std::size_t>(view.contact_count), 0);
  for (std::size_t s = 0; s < 5; ++s)
    for (const Index contact : parts.contacts[s]) {
      ++seen[static_cast<std::size_t>(contact)];
      for (const Index body : {view.body_a[contact], view.body_b[contact]}) {
        if (body < 0) continue;
        EXPECT_THAT(parts.bodies[s], ::testing::Contains(body));
        EXPECT_THAT(parts.holders[static_cast<std::size_t>(body)], ::testing::Contains(static_cast<int>(s)));
      }
    }
  EXPECT_THAT(seen, ::testing::Each(1));
  for (int ranks = 1; ranks <= 7; ++ranks)
    for (int s = 0; s < 5; ++s) {
      EXPECT_GE(parts.rank_of(s, ranks), s == 0 ? 0 : parts.rank_of(s - 1, ranks));
      EXPECT_LT(parts.rank_of(s, ranks), ranks);
    }
}

TEST(Consensus, RefusesWhatItCannotDo) {
  using ::testing::HasSubstr;
  const BodyBatch<double> batch = batch_of(wall());
  const std::vector<int> part = parts_of(batch, 2);
  const auto message = [&](const ConsensusOptions& consensus, const Case& how, const std::vector<int>& parts) {
    return message_of([&] { by_consensus(batch, 2, parts, consensus, how); });
  };
  ConsensusOptions wrong = into(0);
  EXPECT_THAT(message(wrong, sweeps(5), part), HasSubstr("subdomains = 0"));
  wrong = into(2);
  wrong.sweeps = 0;
  EXPECT_THAT(message(wrong, sweeps(5), part), HasSubstr("sweeps = 0"));
  wrong = into(2);
  wrong.penalty = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(message(wrong, sweeps(5), part), HasSubstr("penalty = nan"));
  EXPECT_THAT(message(into(1), sweeps(5), part), HasSubstr("expected a subdomain in 0..0"));
  EXPECT_THAT(message(into(2), sweeps(5), std::vector<int>(41, 0)), HasSubstr("part has 41 elements"));
  Case how = sweeps(5);
  how.options.substeps = 2;
  EXPECT_THAT(message(into(2), how, part), HasSubstr("substeps = 2"));
  how = sweeps(5);
  how.options.method = BodyMethod::newton;
  EXPECT_THAT(message(into(2), how, part), HasSubstr("method"));
}

TEST(Consensus, RanksNoticeThatTheyWereGivenDifferentOptions) {
  const BodyBatch<double> batch = batch_of(wall());
  const std::vector<int> part = parts_of(batch, 2);
  EXPECT_THAT(message_of([&] {
                run_thread_ranks(2, 60, [&](Transport& transport) {
                  BodySolution<double> solution = room_for(batch.view());
                  ConsensusOptions own = into(2);
                  own.penalty = transport.rank() == 1 ? 16 : 32;
                  solve_by_consensus(transport, batch.view(), std::span<const int>(part), own, {}, {},
                                     view_of(solution));
                });
              }),
              ::testing::HasSubstr("rank 1 has another batch, other options"));
}

}  // namespace
}  // namespace stiction::distributed
