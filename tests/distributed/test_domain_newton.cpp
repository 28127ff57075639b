// Newton's method over subdomains: its answers, and that its bits follow the subdomains and no number of ranks.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <span>

#include "distributed/newton/solve_by_newton.hpp"
#include "distributed/solve/partition.hpp"
#include "distributed/transport/thread_transport.hpp"
#include "tests/distributed/rank_cases.hpp"

namespace stiction::distributed {
namespace {

struct Split {
  DomainOptions domains;
  std::vector<int> home;  ///< of each subdomain; empty: neighbours together
};

Split into(int count) {
  Split split;
  split.domains.count = count;
  return split;
}

template <class Real>
BodySolution<Real> by_newton(const BodyBatch<Real>& batch, int ranks, const Split& split, const Case& how,
                             const std::vector<Real>& start = {}, std::vector<RankReport>* report = nullptr,
                             NewtonCounts* counts = nullptr) {
  BodySolution<Real> solution = room_for(batch.view());
  const std::vector<int> part = bisect(centres_by_arms(batch.view()), split.domains.count);
  const std::vector<int> home = split.home.empty() ? neighbouring_homes(split.domains.count, ranks) : split.home;
  run_thread_ranks(ranks, 60, [&](Transport& transport) {
    const bool is_first = transport.rank() == 0;
    NewtonCounts made;
    const auto all =
        solve_by_newton(transport, batch.view(), std::span<const int>(part), std::span<const int>(home), split.domains,
                        how.stepping, how.options, is_first ? view_of(solution) : BodySolutionView<Real>{},
                        start.empty() ? nullptr : start.data(), &made);
    if (is_first && report != nullptr) *report = all;
    if (is_first && counts != nullptr) *counts = made;
  });
  return solution;
}

Case until(double tolerance, Law law, double cfm) {
  Case how = sweeps(200, tolerance);
  how.options.law = law;
  how.options.method = BodyMethod::newton;
  how.stepping.cfm = cfm;
  return how;
}

TEST(DomainNewton, AnIndependentJudgeFindsItsResidual) {
  for (const Law law : {Law::convex, Law::coulomb})
    for (const bool is_pile : {false, true}) {
      const BodyEnvironment<double> env = is_pile ? scenes::make_body_pile(5, 60) : small_wall();
      const Case how = until(1e-8, law, is_pile ? 1e-3 : 0);
      const BodyBatch<double> batch = batch_of(env);
      const BodySolution<double> solution = by_newton(batch, 2, into(3), how);
      SCOPED_TRACE(std::string(to_string(law)) + ", steps " + std::to_string(solution.status[0].iterations) +
                   ", residual " + std::to_string(solution.status[0].residual));
      EXPECT_EQ(solution.status[0].code, EnvCode::solved);
      EXPECT_EQ(solution.status[0].solver, SolverKind::newton);
      EXPECT_LE(verified(env, how, solution), 1.001e-8);
      EXPECT_NEAR(verified(env, how, solution), solution.status[0].residual, 1e-11);
    }
}

TEST(DomainNewton, UnderTheConvexLawItsTwistsAreThoseOfOneProcess) {
  const BodyBatch<double> batch = batch_of(small_wall());
  const Case how = until(1e-10, Law::convex, 1e-3);
  const BodySolution<double> one = by_one_process(batch, how);
  ASSERT_EQ(one.status[0].code, EnvCode::solved);
  for (const int subdomains : {1, 2, 5}) {
    const BodySolution<double> many = by_newton(batch, 2, into(subdomains), how);
    SCOPED_TRACE(subdomains);
    ASSERT_EQ(many.status[0].code, EnvCode::solved);
    // Twists of a convex problem are unique, and R bounds the error that 1e-10 of b can hide.
    EXPECT_LT(largest_difference(many.twist, one.twist), 1e-6);
  }
}

/// 2 to 4 ranks, more ranks than subdomains, and subdomains that are dealt out at random.
template <class Real>
void expect_one_answer(const BodyBatch<Real>& batch, const Split& split, const Case& how,
                       const std::vector<Real>& start = {}) {
  const BodySolution<Real> one = by_newton(batch, 1, split, how, start);
  for (const int ranks : {2, 3, 4, 7}) {
    SCOPED_TRACE(std::to_string(ranks) + " ranks");
    expect_same(by_newton(batch, ranks, split, how, start), one);
  }
  Split dealt = split;
  dealt.home = random_owners(split.domains.count, 3, 11);
  SCOPED_TRACE("dealt out");
  expect_same(by_newton(batch, 3, dealt, how, start), one);
}

TEST(DomainNewton, RanksReachNoBit) {
  Case how = until(0, Law::convex, 1e-5);
  how.options.iterations = 18;  // enough for a better iterate than that of the sweeps before them
  const BodyBatch<double> wide = batch_of(wall());
  expect_one_answer(wide, into(5), how);
  expect_one_answer(single_of(wall()), into(4), how);
  const BodyBatch<double> pile = batch_of(scenes::make_body_pile(5, 200));
  expect_one_answer(pile, into(6), how);
  how.options.law = Law::coulomb;
  how.options.iterations = 20;  // beyond the first renewal
  how.stepping.cfm = 0;
  expect_one_answer(wide, into(5), how);
}

TEST(DomainNewton, SubdomainsReachTheBits) {
  Case how = until(0, Law::convex, 1e-5);
  how.options.iterations = 18;  // enough for a better iterate than that of the sweeps before them
  const BodyBatch<double> batch = batch_of(wall());
  EXPECT_NE(by_newton(batch, 1, into(2), how).impulse, by_newton(batch, 1, into(5), how).impulse);
}

NewtonCounts counts_of(const BodyBatch<double>& batch, int subdomains, bool overlap, bool is_coarse) {
  Split split = into(subdomains);
  split.domains.overlap = overlap;
  split.domains.is_coarse = is_coarse;
  Case how = until(1e-8, Law::convex, 1e-5);
  NewtonCounts counts;
  EXPECT_EQ(by_newton(batch, 1, split, how, {}, nullptr, &counts).status[0].code, EnvCode::solved);
  return counts;
}

/// The factor of a whole matrix is its inverse but for rounding, so one step of gradients is enough, or two.
TEST(DomainNewton, OneSubdomainWithoutACoarseSpaceIsTheInverse) {
  const NewtonCounts counts = counts_of(batch_of(wall()), 1, true, false);
  EXPECT_GE(counts.linear_steps, counts.steps);
  EXPECT_LE(counts.linear_steps, 2 * counts.steps);
}

TEST(DomainNewton, OverlapAndTheCoarseSpaceSaveIterations) {
  const BodyBatch<double> batch = batch_of(scenes::box_bodies(scenes::box_wall(12, 12), 0.5));
  const auto a_step = [&](bool overlap, bool is_coarse) {
    const NewtonCounts counts = counts_of(batch, 9, overlap, is_coarse);
    return static_cast<double>(counts.linear_steps) / static_cast<double>(counts.steps);
  };
  const double neither = a_step(false, false), overlap = a_step(true, false), both = a_step(true, true);
  EXPECT_LT(overlap, 0.8 * neither);
  EXPECT_LT(both, 0.8 * overlap);
}

/// A column of spheres: sweeps find opening contacts, and cost little beside the steps that they save.
TEST(DomainNewton, FirstSweepsSaveSteps) {
  const BodyBatch<double> column = batch_of(scenes::make_body_column(1, 2, 5));
  const Case how = until(1e-6, Law::convex, 1e-5);
  std::vector<Index> steps;
  for (const Index sweeps : {16, 192}) {
    Split split = into(4);
    split.domains.sweeps = sweeps;
    NewtonCounts counts;
    const BodySolution<double> solution = by_newton(column, 1, split, how, {}, nullptr, &counts);
    EXPECT_EQ(solution.status[0].code, EnvCode::solved);
    EXPECT_EQ(counts.sweeps, sweeps);
    steps.push_back(solution.status[0].iterations);
  }
  EXPECT_LT(2 * steps[1], steps[0]) << steps[0] << " and " << steps[1] << " steps";
}

TEST(DomainNewton, SeveralEnvironmentsAndEmptyOnes) {
  const BodyBatch<double> batch = mixed_environments();
  const Case how = until(1e-6, Law::coulomb, 1e-4);
  expect_one_answer(batch, into(3), how);
  const BodySolution<double> solution = by_newton(batch, 2, into(3), how);
  for (const EnvStatus& status : solution.status) EXPECT_EQ(status.code, EnvCode::solved);
  EXPECT_EQ(solution.twist[6 * 43], 1);
  EXPECT_EQ(solution.twist[6 * 43 + 2], 2);
}

TEST(DomainNewton, StartsFromReactions) {
  const BodyBatch<double> batch = batch_of(small_wall());
  Case how = until(1e-7, Law::coulomb, 1e-4);
  std::vector<double> start = by_newton(batch, 1, into(2), how).impulse;
  EXPECT_EQ(by_newton(batch, 2, into(2), how, start).status[0].iterations, 0);
  how.options.iterations = 3;
  how.options.tolerance = 0;
  expect_one_answer(batch, into(2), how, start);
  start[7] = std::numeric_limits<double>::quiet_NaN();
  const BodySolution<double> cold = by_newton(batch, 2, into(2), how, start);
  EXPECT_EQ(cold.status[0].flags, kFlagWarmStartRejected);
  const BodySolution<double> none = by_newton(batch, 2, into(2), how);
  EXPECT_TRUE(test::same_bits(std::span<const double>(cold.impulse), std::span<const double>(none.impulse)));
}

TEST(DomainNewton, BrokenNumbersAreFlaggedAndOthersAreNot) {
  Case how = until(1e-6, Law::convex, 1e-4);
  how.options.invalid = InvalidPolicy::isolate;
  BodyEnvironment<double> broken = wall();
  broken.contacts[20].depth = std::numeric_limits<double>::quiet_NaN();
  BodyEnvironment<double> fast = wall();
  for (auto& body : fast.bodies) body.twist[2] = -1e300;
  fast.bodies[0].twist[2] = 1e308;
  fast.bodies[8].twist[2] = -1.7e308;
  BodyBatch<double> batch;
  for (const auto& env : {wall(), broken, fast}) batch.add(env);
  expect_one_answer(batch, into(3), how);
  const BodySolution<double> solution = by_newton(batch, 2, into(3), how);
  EXPECT_EQ(solution.status[0].code, EnvCode::solved);
  EXPECT_EQ(solution.status[1].code, EnvCode::invalid_input);
  EXPECT_EQ(solution.status[1].flags, kFlagNonFiniteInput);
  EXPECT_NE(solution.status[2].code, EnvCode::solved);
  for (const double number : solution.impulse) EXPECT_TRUE(std::isfinite(number));
}

TEST(DomainNewton, OneRankSendsNothing) {
  const BodyBatch<double> batch = batch_of(wall());
  std::vector<RankReport> report;
  NewtonCounts counts;
  const Case how = until(1e-6, Law::convex, 1e-4);
  by_newton(batch, 1, into(4), how, {}, &report, &counts);
  EXPECT_EQ(report.at(0).exchanges, 0);
  EXPECT_EQ(report.at(0).bytes, 0);
  EXPECT_EQ(report.at(0).ghosts, 0);
  by_newton(batch, 2, into(4), how, {}, &report, &counts);
  ASSERT_EQ(report.size(), 2U);
  // An exchange for each application of the preconditioner and each matrix, beside those of sweeps and collecting.
  EXPECT_GE(report[0].exchanges, counts.linear_steps + 2 * counts.steps);
  EXPECT_EQ(report[0].bodies - report[0].ghosts + report[1].bodies - report[1].ghosts, 42);
}

TEST(Domains, HaveEachBodyAndContactOnceAndAggregatesOfFew) {
  // A chain 0 - 1 - ... - 5 and a body 6 that nothing touches, in three subdomains.
  const std::vector<Index> offsets{0, 2, 5, 8, 11, 14, 16, 17};
  const std::vector<Index> columns{0, 1, 0, 1, 2, 1, 2, 3, 2, 3, 4, 3, 4, 5, 4, 5, 6};
  const BlockPattern chain{7, 7, offsets.data(), columns.data()};
  const std::vector<Index> sides{0, 1, 1, 2, 2, 3, 3, 4, 4, 5, ~Index{6}, ~Index{7}, ~Index{7}, 2};
  const std::vector<int> part{0, 0, 1, 1, 2, 2, 2};
  std::vector<Point> points(7, Point{0, 0, 0});
  for (std::size_t k = 0; k < 7; ++k) points[k][0] = static_cast<double>(k);
  DomainOptions options;
  options.count = 3;
  const Domains made = make_domains(chain, sides.data(), 7, part, points, options);
  EXPECT_EQ(made.bodies, (std::vector<std::vector<Index>>{{0, 1}, {2, 3}, {4, 5, 6}}));
  EXPECT_EQ(made.extended, (std::vector<std::vector<Index>>{{0, 1, 2}, {1, 2, 3, 4}, {3, 4, 5, 6}}));
  EXPECT_EQ(made.contacts, (std::vector<std::vector<Index>>{{0, 1}, {2, 3, 6}, {4, 5}}));
  EXPECT_EQ(made.holders[3], (std::vector<int>{1, 2}));
  EXPECT_EQ(made.aggregate, (std::vector<Index>{0, 0, 1, 1, 2, 2, -1}));
  EXPECT_EQ(made.root, (std::vector<Index>{0, 2, 4}));
  EXPECT_EQ(made.coarse_pattern().blocks(), 7);
}

TEST(DomainNewton, RefusesWhatItCannotDo) {
  using ::testing::HasSubstr;
  const BodyBatch<double> batch = batch_of(wall());
  const auto message = [&](const Split& split, const Case& how) {
    return message_of([&] { by_newton(batch, 2, split, how); });
  };
  Case how = until(1e-6, Law::convex, 1e-4);
  Split wrong = into(2);
  wrong.home = {0, 2};
  EXPECT_THAT(message(wrong, how), HasSubstr("home[1] = 2: expected a rank in 0..1"));
  wrong.home = {0};
  EXPECT_THAT(message(wrong, how), HasSubstr("home has 1 elements"));
  Split without = into(2);
  without.domains.sweeps = 0;
  EXPECT_THAT(message(without, how), HasSubstr("domains.sweeps = 0: expected one or more"));
  how.options.substeps = 2;
  EXPECT_THAT(message(into(2), how), HasSubstr("substeps = 2"));
  how = sweeps(5);
  EXPECT_THAT(message(into(2), how), HasSubstr("method"));
  how = until(1e-6, Law::convex, 1e-4);
  how.options.box_friction = true;
  EXPECT_NE(message(into(2), how), "nothing was thrown");
}

}  // namespace
}  // namespace stiction::distributed
