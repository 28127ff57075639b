#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "core/base/extents.hpp"
#include "core/plan/plan.hpp"
#include "scenes/merge.hpp"
#include "stiction/error.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/systems/island_families.hpp"
#include "tests/support/systems/random_structures.hpp"

/// Islands solved apart from arrays with room, normals last, factors, flags and plans.
namespace {

using namespace stiction;
using namespace stiction::test;
using scenes::merge;

/// Numbers beside the integers of a batch with room; unused ones are NaN.
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
