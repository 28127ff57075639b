#include "core/job/parallel_for.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <functional>
#include <limits>
#include <numeric>
#include <string>
#include <vector>

#include "core/base/dense_rows.hpp"
#include "core/machine/body_machine.hpp"
#include "core/plan/body_plan.hpp"
#include "core/plan/plan.hpp"
#include "core/runtime/check/defects.hpp"
#include "core/runtime/check/survey.hpp"
#include "cpu_fallback/threads/thread_pool.hpp"
#include "tests/support/systems/body_systems.hpp"
#include "tests/support/systems/random_systems.hpp"
#include "tests/support/systems/small_systems.hpp"

/// Looking at a batch and planning it in parts: the same as at once, however it is cut and whichever part comes first.
namespace stiction::test {
namespace {

/// Parts of seven, the last one first.
void from_behind(Offset count, const std::function<void(Offset, Offset)>& work) {
  constexpr Offset kPart = 7;
  for (Offset part = (count + kPart - 1) / kPart; part-- > 0;) work(part * kPart, std::min(count, (part + 1) * kPart));
}

std::vector<std::string> messages(const std::vector<Defect>& defects) {
  std::vector<std::string> found;
  for (const Defect& defect : defects) found.push_back(defect.message);
  return found;
}

/// Only the diagonal of A.
void make_sparse(Environment<double>& env) {
  std::vector<double> diagonal;
  const std::size_t rows = env.mu.size();
  for (std::size_t i = 0; i < rows; ++i) diagonal.push_back(env.A[i * rows + i]);
  env.A = diagonal;
  env.column.resize(rows);
  std::iota(env.column.begin(), env.column.end(), 0);
  std::iota(env.row_offsets.begin(), env.row_offsets.end(), 0);
}

/// Environments of every kind: dense, too sparse for that, without rows, of full rows and not.
ContactBatch<double> mixed_batch(int count) {
  std::vector<Environment<double>> environments;
  for (int e = 0; e < count; ++e) {
    if (e % 11 == 3) {
      environments.emplace_back();
      continue;
    }
    Recipe recipe;
    recipe.seed = static_cast<std::uint64_t>(e);
    recipe.contacts = e % 23 == 5 ? 40 : 1 + e % 6;
    recipe.others = e % 3;
    recipe.order = e % 2 == 0 ? ConeOrder::shuffled : ConeOrder::friction_last;
    environments.push_back(random_contacts(recipe));
    Environment<double>& env = environments.back();
    if (e % 23 == 5) make_sparse(env);
    if (e % 5 == 2) {  // an entry less
      env.column.erase(env.column.begin() + 1);
      env.A.erase(env.A.begin() + 1);
      for (std::size_t i = 1; i < env.row_offsets.size(); ++i) --env.row_offsets[i];
    }
  }
  return batch_of(environments, Law::convex);
}

TEST(ParallelFor, ThreadsCoverEverythingOnce) {
  for (const int threads : {1, 2, 8})
    for (const Offset count : {0, 1, 511, 512, 513, 5000}) {
      std::vector<std::atomic<int>> seen(static_cast<std::size_t>(count));
      cpu::parallel_for(threads, count, [&](Offset begin, Offset end) {
        EXPECT_LT(begin, end);
        for (Offset i = begin; i < end; ++i) ++seen[static_cast<std::size_t>(i)];
      });
      for (const auto& times : seen) EXPECT_EQ(times, 1);
    }
}

TEST(ParallelFor, PlansAreTheSame) {
  const ContactBatch<double> batch = mixed_batch(100);
  const PlanData whole = make_plan(batch.view()), parts = make_plan(batch.view(), from_behind);
  EXPECT_EQ(parts.path, whole.path);
  EXPECT_EQ(parts.counts, whole.counts);
  EXPECT_EQ(parts.cone_order, whole.cone_order);
  EXPECT_EQ(parts.env_vertex_offsets, whole.env_vertex_offsets);
  EXPECT_EQ(parts.vertex_offsets, whole.vertex_offsets);
  EXPECT_EQ(parts.color_offsets, whole.color_offsets);
  EXPECT_EQ(parts.color_count, whole.color_count);
  EXPECT_EQ(parts.dense_order, whole.dense_order);
  EXPECT_EQ(parts.sparse_order, whole.sparse_order);
  EXPECT_TRUE(fits(whole, batch.view(), from_behind));
  for (const std::size_t env : {0U, 50U, 98U}) {
    PlanData other = whole;
    ++other.counts[env].free;
    EXPECT_FALSE(fits(other, batch.view(), from_behind)) << "environment " << env;
  }
  for (const EnvPath path : {EnvPath::empty, EnvPath::dense, EnvPath::sparse})
    EXPECT_NE(std::find(whole.path.begin(), whole.path.end(), path), whole.path.end());
}

TEST(ParallelFor, DefectsAreTheSame) {
  ContactBatch<double> batch = mixed_batch(100);
  const auto view = batch.view();
  std::vector<FullRows> rows_of_whole, rows_of_parts;
  const auto look = [&](const ContactBatchView<double>& at, const ParallelFor& parallel_for,
                        std::vector<FullRows>& rows) {
    return messages(validate(at, 5, SolverKind::npgs, parallel_for, rows));
  };
  EXPECT_TRUE(look(view, all_at_once, rows_of_whole).empty());
  EXPECT_TRUE(look(view, from_behind, rows_of_parts).empty());
  EXPECT_EQ(rows_of_parts, rows_of_whole);
  EXPECT_NE(std::find(rows_of_whole.begin(), rows_of_whole.end(), FullRows::known), rows_of_whole.end());
  EXPECT_NE(std::find(rows_of_whole.begin(), rows_of_whole.end(), FullRows::unknown), rows_of_whole.end());

  // Each array spoiled at one place, near the end and in the middle: found, and reported as before.
  const auto spoiled = [&](auto&& spoil) {
    for (const Offset env : {view.env_count / 2, view.env_count - 2}) {
      ContactBatchView<double> broken = view;
      std::vector<std::vector<double>> numbers;
      std::vector<Index> columns(view.column, view.column + view.nonzero_count);
      std::vector<ConeKind> kinds(view.cone_kind, view.cone_kind + view.cone_count);
      const auto copy = [&](const double*& array, Offset count) -> double* {
        numbers.emplace_back(array, array + count);
        array = numbers.back().data();
        return numbers.back().data();
      };
      numbers.reserve(8);
      double* const A = copy(broken.A, view.nonzero_count);
      double* const b = copy(broken.b, view.row_count);
      double* const R = copy(broken.R, view.row_count);
      double* const mu = copy(broken.mu, view.row_count);
      broken.column = columns.data();
      broken.cone_kind = kinds.data();
      const Offset row = view.env_row_offsets[env];
      spoil(A + view.row_offsets[row], b + row, R + row, mu + row, columns.data() + view.row_offsets[row],
            kinds.data() + view.env_cone_offsets[env]);
      const auto whole = look(broken, all_at_once, rows_of_whole), parts = look(broken, from_behind, rows_of_parts);
      ASSERT_FALSE(whole.empty()) << "environment " << env;
      EXPECT_NE(whole.front().find("env " + std::to_string(env)), std::string::npos) << whole.front();
      EXPECT_EQ(parts, whole);
    }
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  spoiled([&](double* A, double*, double*, double*, Index*, ConeKind*) { A[1] = nan; });
  spoiled([&](double*, double* b, double*, double*, Index*, ConeKind*) { b[0] = nan; });
  spoiled([&](double*, double*, double* R, double*, Index*, ConeKind*) { R[0] = -1.0; });
  spoiled([&](double*, double*, double*, double* mu, Index*, ConeKind*) {
    for (int k = 0; k < 8; ++k) mu[k] = -1.0;  // rows of some friction cone included
  });
  spoiled([&](double*, double*, double*, double*, Index* column, ConeKind*) { column[1] = 1000; });
  spoiled([&](double*, double*, double*, double*, Index*, ConeKind* kind) { kind[0] = static_cast<ConeKind>(9); });
}

/// A sound batch is checked once: finding a defect takes longer.
TEST(Survey, PassesWhatIsNoDefect) {
  ContactBatch<double> batch = mixed_batch(100);
  EXPECT_TRUE(Survey<double>(batch.view(), true, false).passes(all_at_once));
  auto view = batch.view();
  std::vector<std::uint32_t> flags(static_cast<std::size_t>(view.env_count));
  view.env_flags = flags.data();
  flags[50] = kFlagContactsDropped;
  EXPECT_TRUE(Survey<double>(view, true, false).passes(all_at_once));
  flags[50] |= kFlagNonFiniteInput;
  EXPECT_FALSE(Survey<double>(view, true, false).passes(all_at_once));

  // A row without a diagonal, for complementary pivoting: only where no cone has friction.
  for (const bool has_friction : {false, true}) {
    Environment<double> env;
    env.cones = {{ConeKind::unilateral, 1, -1}, {ConeKind::unilateral, 1, -1}};
    if (has_friction) env.cones[1] = {ConeKind::friction, 2, -1};
    const std::size_t rows = has_friction ? 3 : 2;
    std::vector<double> A(rows * rows, 0.0);
    for (std::size_t i = 1; i < rows; ++i) A[i * rows + i] = 1.0;
    env.set_dense(A, static_cast<Index>(rows));
    env.b.assign(rows, 1.0);
    env.mu.assign(rows, 0.5);
    const ContactBatch<double> pivots = batch_of({env}, Law::convex);
    EXPECT_FALSE(Survey<double>(pivots.view(), true, false).passes(all_at_once));
    EXPECT_EQ(Survey<double>(pivots.view(), true, true).passes(all_at_once), !has_friction);
  }
}

TEST(ParallelFor, BodiesAreTheSame) {
  std::vector<BodyEnvironment<double>> environments;
  for (std::uint64_t seed = 0; seed < 60; ++seed)
    environments.push_back(random_bodies(seed, 2 + static_cast<Index>(seed % 9), static_cast<Index>(seed % 40)));
  BodyBatch<double> batch = batch_of(environments);
  for (const Index capacity : {0, 10}) {
    const BodyPlanData whole = make_body_plan(batch.view(), capacity);
    const BodyPlanData parts = make_body_plan(batch.view(), capacity, from_behind);
    EXPECT_EQ(parts.kept, whole.kept);
    EXPECT_EQ(parts.contact_order, whole.contact_order);
    EXPECT_EQ(parts.sides, whole.sides);
    EXPECT_EQ(parts.vertex_offsets, whole.vertex_offsets);
    EXPECT_EQ(parts.color_offsets, whole.color_offsets);
    EXPECT_EQ(parts.color_count, whole.color_count);
    EXPECT_EQ(parts.body_offsets, whole.body_offsets);
    EXPECT_EQ(parts.body_contacts, whole.body_contacts);
  }
  EXPECT_TRUE(validate(batch.view(), 5, from_behind).empty());
  for (const std::size_t env : {59U, 30U, 31U, 8U}) environments[env].contacts.front().mu = -1.0;
  environments[31].bodies.front().inv_mass = -1.0;
  batch = batch_of(environments);
  for (const std::size_t limit : {1U, 2U, 3U, 64U}) {
    const auto whole = messages(validate(batch.view(), limit));
    EXPECT_EQ(whole.size(), std::min<std::size_t>(limit, 5));
    EXPECT_EQ(messages(validate(batch.view(), limit, from_behind)), whole);
  }
  auto view = batch.view();
  std::vector<Index> sides(view.body_a, view.body_a + view.contact_count);
  view.body_a = sides.data();
  for (const std::size_t contact : {sides.size() - 1, sides.size() / 2}) sides[contact] = 999;
  EXPECT_EQ(validate_structure(view, 9, all_at_once).size(), 2U);
  EXPECT_EQ(messages(validate_structure(view, 9, from_behind)), messages(validate_structure(view, 9, all_at_once)));
}

}  // namespace
}  // namespace stiction::test
