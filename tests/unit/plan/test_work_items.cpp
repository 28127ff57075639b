#include "cpu_fallback/pack/work_items.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "tests/support/systems/scene_batches.hpp"

namespace {

using namespace stiction;

const auto kEverybody = [](Offset) { return true; };

/// Counts each environment's deals.
std::vector<int> dealt(const std::vector<cpu::WorkItem<ConeCounts>>& items, Offset envs) {
  std::vector<int> count(static_cast<std::size_t>(envs), 0);
  for (const auto& item : items)
    for (const Offset env : item.envs) ++count[static_cast<std::size_t>(env)];
  return count;
}

/// Packs of so many lanes, whose matrices have numbers of so many bytes.
cpu::WorkItemRules<ConeCounts> rules(int threads, int width, Offset scalar_bytes) {
  return {threads, width, [=](const ConeCounts& slots) {
            const Offset rows = row_count(slots);
            return rows * rows * width * scalar_bytes;
          }};
}

bool fits(const ConeCounts& own, const ConeCounts& slots) {
  bool all = own.free <= slots.free && own.unilateral <= slots.unilateral && own.box <= slots.box;
  for (Index m = 2; m <= kMaxConeRows; ++m) all = all && own.friction[m] <= slots.friction[m];
  return all;
}

TEST(Partition, EveryEnvironmentIsDealtOutExactlyOnce) {
  const auto batch = test::ragged_batch(9, 1);
  const PlanData plan = make_plan(batch.view());
  for (const int width : {2, 4, 8, 16})
    for (const int threads : {1, 2, 7}) {
      const auto items = cpu::make_work_items(plan, kEverybody, rules(threads, width, 8));
      EXPECT_EQ(dealt(items, batch.env_count()), std::vector<int>(static_cast<std::size_t>(batch.env_count()), 1))
          << "width " << width << ", " << threads << " threads";
    }
}

TEST(Partition, APackHoldsDenseEnvironmentsThatFitItsSlots) {
  const auto batch = test::ragged_batch(9, 1);
  const PlanData plan = make_plan(batch.view());
  bool packed = false;
  for (const auto& item : cpu::make_work_items(plan, kEverybody, rules(2, 4, 4))) {
    EXPECT_FALSE(item.envs.empty());
    if (!item.packed) continue;
    packed = true;
    for (const Offset env : item.envs) {
      const auto e = static_cast<std::size_t>(env);
      EXPECT_EQ(plan.path[e], EnvPath::dense);
      EXPECT_TRUE(fits(plan.counts[e], item.shape)) << "environment " << env;
    }
  }
  EXPECT_TRUE(packed);
}

TEST(Partition, ManyEqualEnvironmentsFillPacksAndKeepEveryThreadBusy) {
  const auto batch = test::scene_batch("stack", 512, 1, 2);
  const PlanData plan = make_plan(batch.view());
  for (const int threads : {2, 7}) {
    const auto items = cpu::make_work_items(plan, kEverybody, rules(threads, 8, 4));
    EXPECT_GE(items.size(), static_cast<std::size_t>(threads));
    for (const auto& item : items) {
      EXPECT_TRUE(item.packed);
      EXPECT_GE(item.envs.size(), 8U) << "a pack whose lanes are never all full";
    }
  }
}

TEST(Partition, ALargeEnvironmentIsNotPaddedIntoAPack) {
  // Dense, but W copies of its matrix would leave the cache.
  ContactBatch<double> batch;
  for (int copy = 0; copy < 8; ++copy) {
    constexpr Index kRows = 400;
    Environment<double> env;
    for (Index i = 0; i < kRows; ++i) env.cones.push_back({ConeKind::unilateral, 1, -1});
    env.set_dense(std::vector<double>(std::size_t{kRows} * kRows, 1.0), kRows);
    env.b.assign(kRows, -1.0);
    batch.add(env);
  }
  for (const auto& item : cpu::make_work_items(make_plan(batch.view()), kEverybody, rules(1, 8, 8)))
    EXPECT_FALSE(item.packed);
}

TEST(Partition, AnEmptyBatchIsNoWork) {
  EXPECT_TRUE(cpu::make_work_items(make_plan(ContactBatch<double>().view()), kEverybody, rules(2, 8, 4)).empty());
}

TEST(Partition, OnlyThoseThatAreAskedForAreDealtOut) {
  const auto batch = test::ragged_batch(9, 1);
  const PlanData plan = make_plan(batch.view());
  const auto odd = [](Offset env) { return env % 2 == 1; };
  const std::vector<int> count = dealt(cpu::make_work_items(plan, odd, rules(2, 8, 4)), batch.env_count());
  for (std::size_t env = 0; env < count.size(); ++env) EXPECT_EQ(count[env], env % 2 == 1 ? 1 : 0) << env;
}

}  // namespace
