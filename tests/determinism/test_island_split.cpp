#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/base/extents.hpp"
#include "core/plan/islands.hpp"
#include "scenes/merge.hpp"
#include "stiction/error.hpp"
#include "stiction/residual.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/systems/island_families.hpp"
#include "tests/support/systems/random_systems.hpp"
#include "tests/support/systems/scene_batches.hpp"
#include "tests/support/systems/small_systems.hpp"

/// Islands solved apart: each with the bits of a separate environment.
namespace {

using namespace stiction;
using namespace stiction::test;
using scenes::merge;

template <class Real>
class IslandSplit : public testing::Test {};
using Precisions = testing::Types<float, double>;
TYPED_TEST_SUITE(IslandSplit, Precisions);

/// The record of an environment by its islands' records, written from docs/howto/islands.md.
EnvStatus expected_record(std::span<const EnvStatus> islands) {
  EnvStatus record = islands[0];
  for (const EnvCode code : {EnvCode::solved, EnvCode::rounding, EnvCode::infeasible, EnvCode::stalled,
                             EnvCode::max_iterations, EnvCode::numerical})
    for (const EnvStatus& island : islands) record.code = island.code == code ? code : record.code;
  for (const EnvStatus& island : islands) {
    record.flags |= island.flags;
    record.iterations = std::max(record.iterations, island.iterations);
    record.residual = std::max(record.residual, island.residual);
    record.residual_absolute = std::max(record.residual_absolute, island.residual_absolute);
  }
  record.islands = static_cast<std::int32_t>(islands.size());
  return record;
}

TYPED_TEST(IslandSplit, EveryIslandHasTheBitsItHasAsAnEnvironment) {
  using Real = TypeParam;
  for (const Law law : kBothLaws) {
    const Family<Real> family(law);
    const Islands islands = find_islands(family.whole.view());
    for (std::size_t m = 0; m < family.env.size(); ++m)
      ASSERT_EQ(at(islands.count[at(family.env[m])]), family.merged[m].rows.size());
    ASSERT_GE(islands.count[0], 4);
    for (const SolverKind solver : kAllSolvers)
      for (const bool warm : {false, true}) {
        SCOPED_TRACE(label(solver, law) + (warm ? ", warm" : ""));
        SolverOptions o = options(solver, 1e-3, 40);
        o.stall_window = 8;
        const std::span<const Real> start(family.warm), start_alone(family.warm_alone);
        const auto split = solve(family.whole, apart(o), Device::cpu(), warm ? start : std::span<const Real>());
        const auto alone = solve(family.alone, o, Device::cpu(), warm ? start_alone : std::span<const Real>());
        std::vector<Real> lambda(alone.lambda.size()), w(alone.w.size());
        family.each_row([&](std::size_t there, std::size_t here) {
          lambda[there] = split.lambda[here];
          w[there] = split.w[here];
        });
        EXPECT_TRUE(same_bits(std::span<const Real>(alone.lambda), std::span<const Real>(lambda)));
        EXPECT_TRUE(same_bits(std::span<const Real>(alone.w), std::span<const Real>(w)));
        for (std::size_t m = 0; m < family.env.size(); ++m) {
          const EnvStatus record =
              expected_record(std::span<const EnvStatus>(alone.status)
                                  .subspan(at(family.first_system[m]), family.merged[m].rows.size()));
          EXPECT_TRUE(same_bits(std::span(&record, 1), std::span(&split.status[at(family.env[m])], 1))) << m;
        }
        const auto together = solve(family.whole, o, Device::cpu(), warm ? start : std::span<const Real>());
        EXPECT_FALSE(same_bits(std::span<const Real>(together.lambda), std::span<const Real>(split.lambda)))
            << "these systems cannot tell the modes apart";
      }
  }
}

TYPED_TEST(IslandSplit, AnEnvironmentOfOneIslandHasTheBitsItHasTogether) {
  using Real = TypeParam;
  std::vector<Environment<double>> single{{}, random_system(5), {}, scenes::make("stack", 3, 0, 16).system};
  for (const auto& one : systems(31, false)) single.push_back(one);
  auto among = single;
  among.push_back(merge(systems(1, false), 9).system);
  for (const SolverKind solver : kAllSolvers) {
    const SolverOptions o = options(solver, 1e-3, 24);
    const auto batch = convert<Real>(batch_of(single, Law::coulomb));
    EXPECT_TRUE(same_bits(solve(batch, o), solve(batch, apart(o)))) << "passed through, " << to_string(solver);
    const auto mixed = convert<Real>(batch_of(among, Law::coulomb));
    const auto together = solve_hashes(mixed, o), split = solve_hashes(mixed, apart(o));
    for (std::size_t e = 0; e < single.size(); ++e) EXPECT_EQ(together[e], split[e]) << e << ", " << to_string(solver);
    EXPECT_NE(together.back(), split.back());
  }
}

TYPED_TEST(IslandSplit, ThreadsNeighboursAndDevicesReachNoBit) {
  using Real = TypeParam;
  const Family<Real> family;
  const SolverOptions o = apart(options(SolverKind::npgs, 1e-3, 40));
  const auto expected = solve(family.whole, o);
  for (const int threads : {2, 7}) {
    SolverOptions more = o;
    more.threads = threads;
    EXPECT_TRUE(same_bits(expected, solve(family.whole, more))) << threads << " threads";
  }
  EXPECT_TRUE(same_bits(expected, solve(family.whole, o, Device::emulated())));
  const auto hashes = env_hashes(family.whole, expected);
  std::vector<Offset> backwards(hashes.size());
  std::iota(backwards.rbegin(), backwards.rend(), Offset{0});
  const auto turned = solve_hashes(gather<Real>(family.whole, backwards), o);
  for (std::size_t i = 0; i < hashes.size(); ++i) {
    const Offset env[] = {backwards[i]};
    EXPECT_EQ(turned[i], hashes[at(env[0])]) << env[0];
    EXPECT_EQ(solve_hashes(gather<Real>(family.whole, env), o).at(0), hashes[at(env[0])]) << env[0];
  }
}

TYPED_TEST(IslandSplit, SolvedIsWhatTheJudgeFindsSolved) {
  using Real = TypeParam;
  const Family<Real> family;
  constexpr double kTolerance = 1e-3;
  for (const SolverKind solver : kAllSolvers) {
    const auto solution = solve(family.whole, apart(options(solver, kTolerance, 20000)));
    const auto judged = verify(family.whole.view(), std::span<const Real>(solution.lambda));
    std::size_t solved = 0;
    for (std::size_t e = 0; e < judged.size(); ++e) {
      if (solution.status[e].code != EnvCode::solved) continue;
      ++solved;
      EXPECT_LE(solution.status[e].residual, kTolerance);
      EXPECT_LE(judged[e].relative, kTolerance * (1 + 1e-12)) << "the judge rounds in another order";
    }
    EXPECT_GE(solved, 4U) << to_string(solver);
  }
}

TYPED_TEST(IslandSplit, ABrokenNumberRefusesTheWholeEnvironmentAndNoOther) {
  using Real = TypeParam;
  const Family<Real> family;
  SolverOptions o = options(SolverKind::npgs, 1e-3, 24);
  o.invalid = InvalidPolicy::isolate;
  const auto sound = solve_hashes(family.whole, apart(o));
  auto arrays = family.whole.arrays();
  const auto first = at(arrays.env_row_offsets[at(family.env[1])]);
  arrays.b[first + at(family.merged[1].rows[2][0])] = std::numeric_limits<Real>::quiet_NaN();
  arrays.b[first + at(family.merged[1].rows[0][0])] = std::numeric_limits<Real>::infinity();
  arrays.R[first + at(family.merged[1].rows[1][0])] = Real(-1);
  const auto broken = ContactBatch<Real>::from_arrays(family.whole.law(), arrays);
  const auto together = solve_hashes(broken, o);
  const Solution<Real> solution = solve(broken, apart(o));
  const auto hashes = env_hashes(broken, solution);
  for (std::size_t e = 0; e < hashes.size(); ++e)
    EXPECT_EQ(hashes[e], e == at(family.env[1]) ? together[e] : sound[e]) << e;
  EXPECT_EQ(solution.status[at(family.env[1])].code, EnvCode::invalid_input);

  o.invalid = InvalidPolicy::reject;
  const Solver solver(Device::cpu(), apart(o));
  std::vector<Real> lambda(at(broken.row_count()), Real(77));
  std::vector<EnvStatus> status(at(broken.env_count()));
  EXPECT_THROW(solver.solve(broken.view(), {lambda.data(), nullptr, status.data()}), Error);
  EXPECT_EQ(std::count(lambda.begin(), lambda.end(), Real(77)), broken.row_count()) << "nothing was written";
}

TYPED_TEST(IslandSplit, TheRecordTellsHowManyIslandsWereSolvedApart) {
  using Real = TypeParam;
  const auto robots = [](std::uint64_t count) {
    std::vector<Environment<double>> all;
    for (std::uint64_t k = 0; k < count; ++k) all.push_back(scenes::make("walker", 5, k).system);
    return merge(all, count).system;
  };
  const auto batch = convert<Real>(batch_of({robots(22), robots(1), {}, robots(5), robots(2)}, Law::coulomb));
  const auto told = [](const Solution<Real>& solution) {
    std::vector<std::int32_t> islands;
    for (const EnvStatus& status : solution.status) islands.push_back(status.islands);
    return islands;
  };
  using Told = std::vector<std::int32_t>;
  for (const SolverKind solver : kAllSolvers) {
    const SolverOptions o = options(solver, 1e-3, 24);
    EXPECT_EQ(told(solve(batch, apart(o))), (Told{22, 0, 0, 5, 2})) << to_string(solver);
    EXPECT_EQ(told(solve(batch, o)), Told(5, 0)) << to_string(solver);
  }
  SolverOptions o = apart(options(SolverKind::npgs, 1e-3, 24));
  EXPECT_EQ(told(solve(batch, o, Device::emulated())), (Told{22, 0, 0, 5, 2}));
  // A refused environment has no island that was solved.
  o.invalid = InvalidPolicy::isolate;
  auto arrays = batch.arrays();
  arrays.b.front() = std::numeric_limits<Real>::quiet_NaN();
  EXPECT_EQ(told(solve(ContactBatch<Real>::from_arrays(batch.law(), arrays), o)), (Told{0, 0, 0, 5, 2}));
}

TYPED_TEST(IslandSplit, AnUnsupportedIslandLeavesTheEnvironmentAtRest) {
  using Real = TypeParam;
  const auto skew = system({unilateral(), unilateral()}, {2, 0.5, -0.5, 2}, {-1, -0.0});
  const auto batch = convert<Real>(batch_of({merge({random_system(3), skew}, 2).system}));
  const SolverOptions o = options(SolverKind::apgd, 1e-3, 24);
  EXPECT_TRUE(same_bits(solve(batch, o), solve(batch, apart(o))));
  EXPECT_EQ(solve(batch, apart(o)).status[0].code, EnvCode::unsupported);
}

TYPED_TEST(IslandSplit, ABrokenWarmStartIsSetAsideForItsIslandAlone) {
  using Real = TypeParam;
  const Family<Real> family;
  const SolverOptions o = apart(options(SolverKind::npgs, 1e-3, 24));
  std::vector<Real> warm = family.warm;
  const auto first = at(family.whole.arrays().env_row_offsets[at(family.env[0])]);
  warm[first + at(family.merged[0].rows[1][0])] = std::numeric_limits<Real>::quiet_NaN();
  const auto solution = solve<Real>(family.whole, o, Device::cpu(), warm);
  const auto sound = solve<Real>(family.whole, o, Device::cpu(), family.warm), cold = solve(family.whole, o);
  EXPECT_EQ(solution.status[at(family.env[0])].flags, static_cast<std::uint32_t>(kFlagWarmStartRejected));
  for (std::size_t s = 0; s < family.merged[0].rows.size(); ++s)
    for (const Index row : family.merged[0].rows[s])
      EXPECT_EQ(solution.lambda[first + at(row)], (s == 1 ? cold : sound).lambda[first + at(row)]) << "system " << s;
}

}  // namespace
