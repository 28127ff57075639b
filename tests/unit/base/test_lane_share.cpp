#include "bench/support/lane_share.hpp"

#include <gtest/gtest.h>

#include <numeric>

#include "scenes/rng.hpp"

namespace stiction::bench {
namespace {

std::vector<Index> alternating(std::size_t count, std::size_t period, Index rare, Index often) {
  std::vector<Index> chunks(count, often);
  for (std::size_t i = 0; i < count; i += period) chunks[i] = rare;
  return chunks;
}

void expect_counts(const LaneChunks& counted, Offset useful, Offset spent) {
  EXPECT_EQ(counted.useful, useful);
  EXPECT_EQ(counted.spent, spent);
}

TEST(LaneShare, NothingIsWastedWhereAllTakeAsLong) {
  const std::vector<Index> chunks(256, 7);
  for (const LaneChunks& counted : {lock_step(chunks, 32), refilled(chunks, 16), refilled(chunks, 32, 8)}) {
    expect_counts(counted, 256 * 7, 256 * 7);
    EXPECT_EQ(counted.share(), 1.0);
  }
}

TEST(LaneShare, AWarpWaitsForItsSlowestLane) {
  std::vector<Index> chunks(64, 1);
  chunks[5] = 10;
  expect_counts(lock_step(chunks, 32), 73, 32 * 10 + 32);
}

TEST(LaneShare, APartlyFilledWarpCountsAllItsLanes) {
  expect_counts(lock_step(std::vector<Index>{3, 2}, 32), 5, 96);
  expect_counts(refilled(std::vector<Index>{3, 2}, 32, 8), 5, 96);
}

TEST(LaneShare, ALaneTakesTheNextEnvironment) {
  expect_counts(refilled(std::vector<Index>{3, 1, 1, 1}, 2), 6, 6);
  expect_counts(refilled(std::vector<Index>{1, 1, 3}, 2), 5, 8);
}

TEST(LaneShare, EnvironmentsThatAreSolvedWhenLoadedTakeNoChunk) {
  expect_counts(refilled(std::vector<Index>{0, 2, 0, 2}, 2), 4, 4);
  expect_counts(lock_step(std::vector<Index>(32, 0), 32), 0, 0);
  expect_counts(refilled(std::vector<Index>(200, 0), 32, 8), 0, 0);
  EXPECT_EQ(LaneChunks{}.share(), 1.0);
}

// After the first chunk eight of 32 go on, and 24 new ones join them. Seven that are free would wait.
TEST(LaneShare, LanesThatAreFreeWaitForOthers) {
  std::vector<Index> chunks = alternating(32, 4, 2, 1);
  chunks.insert(chunks.end(), 24, 1);
  expect_counts(refilled(chunks, 32, 24), 64, 64);
  expect_counts(refilled(chunks, 32, 25), 64, 96);
}

TEST(LaneShare, EveryChunkIsCountedOnceWhateverTheSchedule) {
  scenes::Rng rng(7);
  std::vector<Index> chunks;
  for (int i = 0; i < 3000; ++i) chunks.push_back(rng.below(1 + 20 / (1 + i % 5)));
  const Offset all = std::accumulate(chunks.begin(), chunks.end(), Offset{0});
  for (const std::size_t intake : {1, 2, 8, 32}) {
    const LaneChunks counted = refilled(chunks, 32, intake);
    EXPECT_EQ(counted.useful, all);
    EXPECT_GE(counted.share(), lock_step(chunks, 32).share());
    EXPECT_LE(counted.share(), 1.0);
  }
  EXPECT_EQ(lock_step(chunks, 32).useful, all);
  EXPECT_EQ(refilled(chunks, 16).useful, all);
  EXPECT_GT(refilled(chunks, 16).share(), 0.95);
}

}  // namespace
}  // namespace stiction::bench
