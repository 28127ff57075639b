// Times are compared with one another and with a thread's sleep, which is a lower bound; never with a clock's limit.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <numeric>
#include <span>
#include <stdexcept>
#include <thread>
#include <vector>

#include "cpu_fallback/threads/thread_pool.hpp"
#include "cpu_fallback/threads/thread_team.hpp"
#include "scenes/body_scenes.hpp"
#include "scenes/worlds.hpp"
#include "stiction/bodies.hpp"
#include "stiction/hash.hpp"
#include "stiction/thread_meter.hpp"
#include "stiction/trace.hpp"
#include "tests/support/systems/scene_batches.hpp"
#include "tests/support/systems/small_systems.hpp"

namespace stiction::test {
namespace {

void sleep_ms(int milliseconds) {
  std::this_thread::sleep_for(std::chrono::milliseconds(milliseconds));
}

double sum(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0);
}

class ThreadMeters : public testing::TestWithParam<cpu::PoolKind> {
 protected:
  void SetUp() override {
    if (!cpu::has_pool(GetParam())) GTEST_SKIP() << "built without oneTBB";
  }
};

INSTANTIATE_TEST_SUITE_P(Kinds, ThreadMeters, testing::Values(cpu::PoolKind::own, cpu::PoolKind::tbb),
                         [](const auto& kind) { return kind.param == cpu::PoolKind::own ? "own" : "tbb"; });

TEST(ThreadUse, SharesOfNumbersThatOneCanWorkOut) {
  // Two sections of 4 threads: 2 s and 3 s, of 20 thread-seconds 12 at work, the busiest thread 5 of them.
  ThreadMeter meter;
  meter.add(2, std::vector<double>{2, 1, 1, 0});
  meter.add(3, std::vector<double>{3, 2, 2, 1});
  EXPECT_DOUBLE_EQ(meter.use().seconds, 5);
  EXPECT_DOUBLE_EQ(meter.use().available, 20);
  EXPECT_EQ(meter.use().busy, (std::vector<double>{5, 3, 3, 1}));
  EXPECT_DOUBLE_EQ(meter.use().synchronisation_share(), 0.4);
  EXPECT_DOUBLE_EQ(meter.use().imbalance(), 5 / 3.0);
  meter.add(1, std::vector<double>{1});  // a section of one thread: 21 thread-seconds, 13 at work
  EXPECT_DOUBLE_EQ(meter.use().synchronisation_share(), 8 / 21.0);
  EXPECT_DOUBLE_EQ(meter.use().imbalance(), 24 / 13.0);
  EXPECT_EQ(ThreadUse{}.synchronisation_share(), 0);
  EXPECT_EQ(ThreadUse{}.imbalance(), 1);
}

TEST_P(ThreadMeters, AnItemOfOneThreadLeavesTheOthersWaiting) {
  ThreadMeter meter;
  cpu::parallel_for(GetParam(), 4, 1, [](int, int) { sleep_ms(5); });
  const ThreadUse& use = meter.use();
  ASSERT_EQ(use.busy.size(), 4U);
  EXPECT_GE(use.busy[0], 0.005);
  EXPECT_EQ(sum(use.busy), use.busy[0]);
  EXPECT_GE(use.seconds, use.busy[0]);
  EXPECT_DOUBLE_EQ(use.available, 4 * use.seconds);
  EXPECT_GE(use.synchronisation_share(), 0.75 - 1e-12);
  EXPECT_DOUBLE_EQ(use.imbalance(), 4);
}

TEST_P(ThreadMeters, WorkOfAllItemsIsCounted) {
  ThreadMeter meter;
  cpu::parallel_for(GetParam(), 3, 12, [](int, int) { sleep_ms(2); });
  EXPECT_GE(sum(meter.use().busy), 0.024);
  EXPECT_LE(sum(meter.use().busy), meter.use().available);
  // Up to the rounding of the mean; 3 where one thread was so quick that it took all items.
  EXPECT_GE(meter.use().imbalance(), 1 - 1e-12);
  EXPECT_LE(meter.use().imbalance(), 3 + 1e-12);
}

TEST_P(ThreadMeters, ASectionWithinASectionIsItsWork) {
  ThreadMeter meter;
  cpu::parallel_for(GetParam(), 2, 6,
                    [&](int, int) { cpu::parallel_for(GetParam(), 3, 5, [](int, int) { sleep_ms(1); }); });
  EXPECT_EQ(meter.use().busy.size(), 2U);
  EXPECT_DOUBLE_EQ(meter.use().available, 2 * meter.use().seconds);
  EXPECT_LE(sum(meter.use().busy), meter.use().available);
}

TEST_P(ThreadMeters, AnExceptionEndsTheSectionAndTheMeterGoesOn) {
  ThreadMeter meter;
  const auto fail = [](int item, int) {
    if (item == 1) throw std::runtime_error("item");
  };
  EXPECT_THROW(cpu::parallel_for(GetParam(), 2, 4, fail), std::runtime_error);
  const double before = meter.use().seconds;
  EXPECT_GT(before, 0);
  cpu::parallel_for(GetParam(), 2, 4, [](int, int) { sleep_ms(1); });
  EXPECT_GE(meter.use().seconds, before + 0.002);
}

TEST_P(ThreadMeters, OnlyTheLastMeterOfTheThreadMeasures) {
  ThreadMeter outer;
  {
    ThreadMeter inner;
    cpu::parallel_for(GetParam(), 2, 4, [](int, int) { sleep_ms(1); });
    EXPECT_GT(inner.use().seconds, 0);
    std::thread other([&] { cpu::parallel_for(GetParam(), 5, 10, [](int, int) { sleep_ms(1); }); });
    other.join();
    EXPECT_EQ(inner.use().busy.size(), 2U) << "the other thread's sections are not this meter's";
  }
  EXPECT_EQ(outer.use().seconds, 0);
  cpu::parallel_for(GetParam(), 2, 4, [](int, int) {});
  EXPECT_GT(outer.use().seconds, 0);
}

TEST_P(ThreadMeters, WaitsAreSpansOfTheTrace) {
  Tracer tracer;
  ThreadMeter meter(&tracer);
  cpu::parallel_for(GetParam(), 3, 1, [](int, int) { sleep_ms(4); });
  std::vector<double> waited(3, -1);
  for (const Span& span : tracer.spans()) {
    EXPECT_STREQ(span.name, "wait");
    waited.at(static_cast<std::size_t>(span.lane)) = span.duration;
  }
  EXPECT_GE(waited[0], 0);
  EXPECT_GE(waited[1], 4000) << "all the section, which lasted longer than its item slept";
  EXPECT_GE(waited[2], 4000);
  EXPECT_LE(waited[0] + 4000, waited[1]);
}

/// A thread of a team waits at the barrier while the other one sleeps.
TEST(ThreadMeterOfATeam, BarriersAreNoWork) {
  ThreadMeter meter;
  std::atomic<bool> begun{false};
  cpu::run_team(2, [&](cpu::ThreadTeam& team, Index rank) {
    if (rank == 0) {
      begun.wait(false);
      sleep_ms(300);
    } else {
      begun = true;
      begun.notify_all();
    }
    team.sync();
  });
  const ThreadUse& use = meter.use();
  ASSERT_EQ(use.busy.size(), 2U);
  EXPECT_GE(use.busy[0], 0.3);
  EXPECT_LT(use.busy[1], use.busy[0] - 0.1) << "it waited 0.3 s, less what it needed to come to the barrier";
  EXPECT_DOUBLE_EQ(use.available, 2 * use.seconds);
  cpu::run_team(2, [&](cpu::ThreadTeam& team, Index) { team.sync(); });
  EXPECT_GT(use.seconds, 0.3);
}

TEST(ThreadMeterOfASolve, ChangesNoBitAndSeesItsThreads) {
  const ContactBatch<double> batch = ragged_batch(4, 5);
  SolverOptions o = options(SolverKind::npgs, 1e-3, 40);
  const auto expected = solve_hashes(batch, o);
  for (const int threads : {1, 2, 3}) {
    o.threads = threads;
    ThreadMeter meter;
    EXPECT_EQ(solve_hashes(batch, o), expected);
    EXPECT_EQ(meter.use().busy.size(), static_cast<std::size_t>(threads));
    EXPECT_GT(sum(meter.use().busy), 0);
    EXPECT_LE(sum(meter.use().busy), meter.use().available);
    EXPECT_GE(meter.use().synchronisation_share(), 0);
  }
}

TEST(ThreadMeterOfASolve, ChangesNoBitOfATeamAndSeesItsThreads) {
  BodyBatch<double> batch;
  batch.add(scenes::make_body_pile(2, 5000));  // above 4096 contacts a team of threads sweeps it together
  ASSERT_GE(batch.view().contact_count, 4096);
  BodySolverOptions o;
  o.iterations = 5;
  o.threads = 2;
  const auto expected = solve_bodies(batch, {}, o);
  ThreadMeter meter;
  const auto measured = solve_bodies(batch, {}, o);
  EXPECT_EQ(hash_bits(std::span<const double>(measured.twist)), hash_bits(std::span<const double>(expected.twist)));
  EXPECT_EQ(measured.impulse, expected.impulse);
  ASSERT_EQ(meter.use().busy.size(), 2U);
  EXPECT_GT(meter.use().busy[0], 0);
  EXPECT_GT(meter.use().busy[1], 0);
  EXPECT_LE(sum(meter.use().busy), meter.use().available);
}

/// Hash of worlds after some steps.
std::uint64_t stepped(int threads) {
  const scenes::WorldScene scene = scenes::make_world("pile");
  WorldOptions o;
  o.stepping = scene.stepping;
  o.solver.threads = threads;
  o.solver.iterations = 10;
  World<double> world(Device::cpu(), scene.description, 20, o);
  scenes::start_all(world, "pile", 1);
  for (int step = 0; step < 5; ++step) world.step();
  return world.hash();
}

TEST(ThreadMeterOfAWorld, ChangesNoBitAndSeesItsThreads) {
  const std::uint64_t expected = stepped(2);
  ThreadMeter meter;
  EXPECT_EQ(stepped(2), expected);
  EXPECT_EQ(meter.use().busy.size(), 2U);
  EXPECT_GT(sum(meter.use().busy), 0);
}

}  // namespace
}  // namespace stiction::test
