#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "bench/scenes/merge.hpp"
#include "core/base/extents.hpp"
#include "core/plan/islands.hpp"
#include "core/plan/plan.hpp"
#include "stiction/error.hpp"
#include "stiction/residual.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/random_structures.hpp"
#include "tests/support/random_systems.hpp"
#include "tests/support/scene_batches.hpp"
#include "tests/support/small_systems.hpp"

/// Islands solved apart: each with the bits of an environment of its own.
namespace {

using namespace stiction;
using namespace stiction::test;
using scenes::merge;
using scenes::Merged;

SolverOptions apart(SolverOptions options) {
  options.islands = IslandMode::apart;
  return options;
}

Environment<double> random_system(std::uint64_t seed, int contacts = 3, int others = 3) {
  Recipe recipe;
  recipe.seed = seed;
  recipe.contacts = contacts;
  recipe.others = others;
  return random_contacts(recipe);
}

/// Systems of one island each, between them: every kind of cone, boxes, manifolds, easy ones and hard ones, all but the
/// last few small; `tall` is a stack that is solved sparsely.
std::vector<Environment<double>> systems(std::uint64_t seed, bool tall) {
  std::vector<Environment<double>> all{random_system(seed),           random_system(seed + 1, 1, 0),
                                       random_system(seed + 2, 0, 1), scenes::make("stack", seed, 0, 2).system,
                                       random_system(seed + 3, 6, 2), scenes::make("grasp", seed, 1, 2).system};
  if (tall) all.push_back(scenes::make("stack", seed, 1, 16).system);
  for (double& b : all[1].b) b *= 1e3;  // scales differ from island to island
  for (double& b : all[4].b) b *= 1e-4;
  std::erase_if(all, [](const Environment<double>& one) { return find_islands(batch_of({one}).view()).count[0] != 1; });
  return all;
}

/// Merged environments among others, and their systems as environments of a batch of their own.
template <class Real>
struct Family {
  explicit Family(Law law = Law::coulomb) : whole(law), alone(law) {
    ContactBatch<double> merged_batch(law), system_batch(law);
    for (std::uint64_t e = 0; e < 4; ++e) {
      const auto parts = systems(10 * e + 1, e == 2);
      merged.push_back(merge(parts, e));
      env.push_back(merged_batch.env_count());
      merged_batch.add(merged.back().system);
      merged_batch.add(e == 1 ? Environment<double>{} : random_system(77 + e));
      first_system.push_back(system_batch.env_count());
      for (const auto& part : parts) system_batch.add(part);
    }
    whole = convert<Real>(merged_batch);
    alone = convert<Real>(system_batch);
    for (Offset row = 0; row < whole.row_count(); ++row) warm.push_back(Real(0.01) * static_cast<Real>(row % 7));
    warm_alone.resize(at(alone.row_count()));
    each_row([&](std::size_t there, std::size_t here) { warm_alone[there] = warm[here]; });
  }

  /// visit(row of the systems' batch, row of the merged one)
  template <class Visit>
  void each_row(const Visit& visit) const {
    for (std::size_t m = 0; m < merged.size(); ++m)
      for (std::size_t s = 0; s < merged[m].rows.size(); ++s)
        for (std::size_t i = 0; i < merged[m].rows[s].size(); ++i)
          visit(at(alone.arrays().env_row_offsets[at(first_system[m]) + s]) + i,
                at(whole.arrays().env_row_offsets[at(env[m])]) + at(merged[m].rows[s][i]));
  }

  ContactBatch<Real> whole, alone;
  std::vector<Real> warm, warm_alone;
  std::vector<Merged> merged;
  std::vector<Offset> env, first_system;  ///< place in `whole`; place of its first system in `alone`
};

template <class Real>
class IslandSplit : public testing::Test {};
using Precisions = testing::Types<float, double>;
TYPED_TEST_SUITE(IslandSplit, Precisions);

/// The record of an environment by its islands' records, written from docs/islands.md.
template <class Real>
EnvStatus expected_record(std::span<const EnvStatus> islands, std::span<const Real> b) {
  EnvStatus record = islands[0];
  double largest_b = 0;
  for (const Real value : b) largest_b = std::max(largest_b, std::abs(static_cast<double>(value)));
  for (const EnvCode code : {EnvCode::solved, EnvCode::stalled, EnvCode::max_iterations, EnvCode::numerical})
    for (const EnvStatus& island : islands) record.code = island.code == code ? code : record.code;
  for (const EnvStatus& island : islands) {
    record.flags |= island.flags;
    record.iterations = std::max(record.iterations, island.iterations);
    record.residual_absolute = std::max(record.residual_absolute, island.residual_absolute);
  }
  record.residual = record.residual_absolute / largest_b;
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
          const auto& rows = family.whole.arrays().env_row_offsets;
          const auto first = at(rows[at(family.env[m])]), last = at(rows[at(family.env[m]) + 1]);
          const EnvStatus record =
              expected_record<Real>(std::span<const EnvStatus>(alone.status)
                                        .subspan(at(family.first_system[m]), family.merged[m].rows.size()),
                                    std::span<const Real>(family.whole.arrays().b).subspan(first, last - first));
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

/// Numbers beside the integers of a batch with room; what is not in use is NaN.
struct Roomy {
  Roomy(const ContactBatch<double>& packed, std::mt19937& random)
      : wide(with_room(packed.view(), random)), view(wide.view()) {
    const auto& from = packed.arrays();
    A.assign(at(wide.nonzeros), std::numeric_limits<double>::quiet_NaN());
    for (auto* values : {&b, &R, &mu, &lo, &hi}) values->assign(at(view.row_count), A.empty() ? 0.0 : A[0]);
    each_row(packed, [&](std::size_t here, std::size_t there) {
      b[here] = from.b[there];
      R[here] = from.R[there];
      mu[here] = from.mu[there];
      lo[here] = from.lo[there];
      hi[here] = from.hi[there];
      std::copy(from.A.begin() + from.row_offsets[there], from.A.begin() + from.row_offsets[there + 1],
                A.begin() + wide.row_offsets[here]);
    });
    view.A = A.data();
    view.b = b.data();
    view.R = R.data();
    view.mu = mu.data();
    view.lo = lo.data();
    view.hi = hi.data();
    view.law = packed.law();
  }
  /// visit(row with room, packed row)
  template <class Visit>
  void each_row(const ContactBatch<double>& packed, const Visit& visit) const {
    for (Offset env = 0; env < packed.env_count(); ++env)
      for (Index row = 0; row < view.env_rows(env); ++row)
        visit(at(wide.env_row_offsets[at(env)] + row), at(packed.arrays().env_row_offsets[at(env)] + row));
  }

  Integers wide;
  ContactBatchView<double> view;
  std::vector<double> A, b, R, mu, lo, hi;
};

TEST(IslandSplitViews, ArraysWithRoomAreReadWhereTheyLie) {
  const Family<double> family;
  const SolverOptions o = apart(options(SolverKind::npgs, 1e-3, 24));
  const auto expected = solve(family.whole, o);
  std::mt19937 random(4);
  const Roomy roomy(family.whole, random);
  std::vector<double> lambda(at(roomy.view.row_count), 77), w(lambda), packed(expected.lambda.size()), moved(packed);
  std::vector<EnvStatus> status(expected.status.size());
  Solver(Device::cpu(), o).solve(roomy.view, SolutionView<double>{lambda.data(), w.data(), status.data()});
  roomy.each_row(family.whole, [&](std::size_t here, std::size_t there) {
    packed[there] = lambda[here];
    moved[there] = w[here];
    lambda[here] = w[here] = 77;
  });
  EXPECT_TRUE(same_bits(expected, Solution<double>{packed, moved, status}));
  const auto rubbish = static_cast<std::ptrdiff_t>(lambda.size());
  EXPECT_EQ(std::count(lambda.begin(), lambda.end(), 77), rubbish) << "room that no row uses was written";
  EXPECT_EQ(std::count(w.begin(), w.end(), 77), rubbish);
}

/// The environments with the normals last and one mu for all rows of a contact.
TEST(IslandSplitViews, NormalsMayComeLastAndMuByContact) {
  std::vector<Environment<double>> parts;
  for (std::uint64_t e = 0; e < 4; ++e) {
    parts.push_back(random_system(20 + e));
    Index row = 0;
    for (const auto& cone : parts.back().cones) {
      for (Index k = 2; k < cone.row_count; ++k) parts.back().mu[at(row + k)] = parts.back().mu[at(row + 1)];
      row += cone.row_count;
    }
  }
  const auto merged = merge(parts, 3);
  const auto first = batch_of({merged.system, parts[0]}, Law::coulomb);
  auto arrays = first.arrays();
  // new_row[i]: where row i goes.
  std::vector<Offset> new_row(at(first.row_count())), mu_offsets(new_row.size(), 1 << 20);
  std::vector<double> mu;
  for (std::size_t c = 0; c < arrays.cone_kind.size(); ++c) {
    const Offset begin = arrays.cone_row_offsets[c], end = arrays.cone_row_offsets[c + 1];
    for (Offset row = begin; row < end; ++row) new_row[at(row)] = row == begin ? end - 1 : row - 1;
    if (arrays.cone_kind[c] != ConeKind::friction) continue;
    for (Offset row = begin; row + 1 < end; ++row) mu_offsets[at(row)] = static_cast<Offset>(mu.size());
    mu.push_back(arrays.mu[at(begin) + 1]);
  }
  const auto& old = first.arrays();
  std::vector<std::size_t> source(new_row.size());
  for (std::size_t i = 0; i < new_row.size(); ++i) source[at(new_row[i])] = i;
  arrays.column.clear();
  arrays.A.clear();
  for (std::size_t i = 0; i < source.size(); ++i) {
    const Offset env_first = at(old.env_row_offsets[1]) <= i ? old.env_row_offsets[1] : 0;
    for (Offset k = old.row_offsets[source[i]]; k < old.row_offsets[source[i] + 1]; ++k) {
      arrays.column.push_back(static_cast<Index>(new_row[at(env_first + old.column[at(k)])] - env_first));
      arrays.A.push_back(old.A[at(k)]);
    }
    arrays.row_offsets[i + 1] = static_cast<Offset>(arrays.A.size());
    arrays.b[i] = old.b[source[i]];
    arrays.R[i] = old.R[source[i]];
    arrays.lo[i] = old.lo[source[i]];
    arrays.hi[i] = old.hi[source[i]];
  }
  const auto last = ContactBatch<double>::from_arrays(Law::coulomb, std::move(arrays));
  auto view = last.view();
  view.normal_last = true;
  view.mu = mu.data();
  view.mu_offsets = mu_offsets.data();
  view.mu_count = static_cast<Offset>(mu.size());
  const SolverOptions o = apart(options(SolverKind::npgs, 1e-3, 24));
  const auto expected = solve(first, o);
  Solution<double> actual{std::vector<double>(source.size()), std::vector<double>(source.size()),
                          std::vector<EnvStatus>(2)};
  Solver(Device::cpu(), o).solve(view, {actual.lambda.data(), actual.w.data(), actual.status.data()});
  Solution<double> turned = actual;
  for (std::size_t i = 0; i < source.size(); ++i) {
    turned.lambda[source[i]] = actual.lambda[i];
    turned.w[source[i]] = actual.w[i];
  }
  EXPECT_TRUE(same_bits(expected, turned));
}

TEST(IslandSplitViews, AFactorIsOneIsland) {
  auto arrays = batch_of({merge({random_system(1), random_system(2)}, 5).system}).arrays();
  // Two unilateral rows over one degree of freedom: no stored entry joins them, the factor does.
  arrays.env_row_offsets.push_back(arrays.env_row_offsets.back() + 2);
  arrays.env_cone_offsets.push_back(arrays.env_cone_offsets.back() + 2);
  for (int row = 0; row < 2; ++row) {
    arrays.cone_kind.push_back(ConeKind::unilateral);
    arrays.cone_row_offsets.push_back(arrays.cone_row_offsets.back() + 1);
    arrays.row_offsets.push_back(arrays.row_offsets.back());
    arrays.b.push_back(-1 - row);
    arrays.R.push_back(0.1);
    for (auto* zeros : {&arrays.mu, &arrays.lo, &arrays.hi}) zeros->push_back(0);
    arrays.factor.push_back(1 + row);
  }
  arrays.factor_offsets = {0, 0, 2};
  const auto batch = ContactBatch<double>::from_arrays(Law::convex, std::move(arrays));
  ASSERT_EQ(make_plan(batch.view()).path[1], EnvPath::factor);
  const SolverOptions o = options(SolverKind::npgs, 1e-3, 24);
  const auto together = solve_hashes(batch, o), split = solve_hashes(batch, apart(o));
  EXPECT_EQ(split[1], together[1]);
  EXPECT_NE(split[0], together[0]);
}

TEST(IslandSplitUse, FlagsOfTheBatchReachEveryIslandAndItsEnvironment) {
  auto arrays = batch_of({merge({random_system(1), random_system(2)}, 5).system, random_system(3)}).arrays();
  arrays.env_flags = {kFlagContactsDropped, 0};
  const auto full = ContactBatch<double>::from_arrays(Law::convex, arrays);
  const SolverOptions o = apart(options(SolverKind::npgs, 1e-3, 2000));
  auto solution = solve(full, o);
  EXPECT_EQ(solution.status[0].flags, static_cast<std::uint32_t>(kFlagContactsDropped));
  EXPECT_EQ(solution.status[0].code, EnvCode::solved);
  EXPECT_EQ(solution.status[1].flags, 0U);
}

TEST(IslandSplitUse, APlanMayBeUsedAndMotionMayBeLeftOut) {
  const Family<double> family;
  const Solver solver(Device::cpu(), apart(options(SolverKind::npgs, 1e-3, 24)));
  const auto expected = solve(family.whole, solver.options());
  std::vector<double> lambda(expected.lambda.size());
  std::vector<EnvStatus> status(expected.status.size());
  solver.solve(solver.plan(family.whole.view()), family.whole.view(), {lambda.data(), nullptr, status.data()});
  EXPECT_TRUE(same_bits(std::span<const double>(expected.lambda), std::span<const double>(lambda)));
  EXPECT_TRUE(same_bits(std::span<const EnvStatus>(expected.status), std::span<const EnvStatus>(status)));
  EXPECT_TRUE(solve(ContactBatch<double>(), solver.options()).status.empty());
}

TEST(IslandSplitUse, AColumnBrokenAfterPlanningIsFlagged) {
  const auto batch = batch_of({merge({random_system(1), random_system(2)}, 5).system});
  SolverOptions o = apart({});
  o.invalid = InvalidPolicy::isolate;
  const Solver solver(Device::cpu(), o);
  const Plan plan = solver.plan(batch.view());
  auto arrays = batch.arrays();
  arrays.column[0] = 1 << 20;
  const auto broken = ContactBatch<double>::from_arrays(batch.law(), arrays);
  std::vector<double> lambda(at(batch.row_count()));
  EnvStatus status{};
  solver.solve(plan, broken.view(), {lambda.data(), nullptr, &status});
  EXPECT_EQ(status.code, EnvCode::invalid_input);
  EXPECT_NE(status.flags & kFlagBadStructure, 0U);
  EXPECT_EQ(lambda, std::vector<double>(lambda.size(), 0.0));
}

TEST(IslandSplitUse, ABatchInDeviceMemoryIsRefusedWithTheRemedy) {
  const auto batch = batch_of({random_system(1)});
  auto view = batch.view();
  view.space = MemorySpace::cuda;  // the emulated device's memory is any
  const Solver solver(Device::emulated(), apart({}));
  std::vector<double> lambda(at(batch.row_count()), 77);
  EnvStatus status{};
  const SolutionView<double> out{lambda.data(), nullptr, &status};
  for (const bool check : {true, false}) {
    try {
      check ? solver.check(view, out) : solver.solve(view, out);
      ADD_FAILURE() << "it was taken";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::unsupported);
      for (const char* part : {"options.islands", "Solver::to_host", "together"})
        EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
    }
  }
  EXPECT_EQ(std::count(lambda.begin(), lambda.end(), 77), batch.row_count());
}

}  // namespace
