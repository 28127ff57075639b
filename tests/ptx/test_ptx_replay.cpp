#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/ptx/lane.hpp"
#include "tests/ptx/replay.hpp"

/// The replay of warps in lock-step, over small kernels whose counts are known (lockstep.ptx).
namespace {

using namespace stiction;
using namespace stiction::ptx;

/// Counts of the one warp that a launch of one team has.
struct Counted {
  Issued all;
  u64 launches = 0;
  [[nodiscard]] u64 instructions() const { return all.instructions; }
  [[nodiscard]] u64 lanes() const { return all.lanes; }
  [[nodiscard]] u64 barriers() const { return all.barriers; }
  [[nodiscard]] u64 of(Memory memory) const { return all.of(memory); }
};

Counted count(const std::string& name) {
  struct Arguments {
    unsigned char* out;
    u64 unused = 0;
  };
  static std::vector<unsigned char> memory(4096);
  const auto begin = reinterpret_cast<u64>(memory.data());
  const Arguments arguments{memory.data() + (128 - begin % 128)};
  cuda::EmulatedLaunch launch{};
  launch.shape = {1, 32, 8192, false};
  std::vector<TracedLaunch> launches;
  record_traces(&launches);
  for (Kernel* const kernel : kernels())
    if (kernel->name == name) ptx::launch(*kernel, launch, &arguments);
  record_traces(nullptr);
  Counted counted;
  counted.launches = launches.size();
  for (const TracedLaunch& one : launches) {
    EXPECT_EQ(one.kernel, name);
    replay(one, {place_of(arguments.out, 2048, Memory::output)}, counted.all);
  }
  EXPECT_EQ(counted.launches, 1U) << name;
  return counted;
}

TEST(PtxReplay, BothSidesOfABranchAreIssued) {
  const Counted found = count("branches");
  EXPECT_EQ(found.instructions(), 4U + 3U + 1U + 2U);
  EXPECT_EQ(found.lanes(), 32U * (4 + 2) + 16U * (3 + 1));
}

TEST(PtxReplay, ALoopIsIssuedAsOftenAsItsLongestLaneTakesIt) {
  const Counted found = count("loops");
  EXPECT_EQ(found.instructions(), 2U + 32U * 3U + 1U);
  EXPECT_EQ(found.lanes(), 32U * 3 + 3U * (32 * 33 / 2));
}

TEST(PtxReplay, LanesThatLeaveAFunctionEarlyWaitForTheOthersBehindTheCall) {
  const Counted found = count("calls");
  EXPECT_EQ(found.instructions(), 3U + 2U + (3U + 2U + 1U) + 2U);
  EXPECT_EQ(found.lanes(), 32U * 3 + 31U * (2 + 3 + 1 + 2) + 24U * 2);
  EXPECT_EQ(found.all.by_function.at("early"), 6U);
}

TEST(PtxReplay, SectorsAreThoseThatLanesTouchTogether) {
  const Counted found = count("sectors");
  EXPECT_EQ(found.of(Memory::output), 4U + 32U + 8U + 1U + 8U);
  EXPECT_EQ(found.of(Memory::parameters) + found.of(Memory::stack) + found.of(Memory::shared), 0U);
}

TEST(PtxReplay, WavefrontsAreThoseOfTheBusiestBank) {
  EXPECT_EQ(count("banks").of(Memory::shared), 1U + 2U + 2U + 32U + 1U + 2U + 4U);
}

TEST(PtxReplay, TeamsOfAWarpWaitByThemselves) {
  const Counted found = count("halves");
  EXPECT_EQ(found.instructions(), 5U + 4U * 4U + 1U);
  EXPECT_EQ(found.lanes(), 32U * 6 + 16U * (2 + 4) * 4);
  EXPECT_EQ(found.barriers(), 4U);
}

TEST(PtxReplay, ALaneThatOthersWaitForDoesNotWaitForThem) {
  const Counted found = count("apart");
  EXPECT_EQ(found.lanes(), 32U * (3 + 1 + 2 + 1));
  EXPECT_EQ(found.instructions(), 3U + 1U + 2 * 2U + 1U + 1U);
  EXPECT_EQ(found.barriers(), 2U);
}

}  // namespace
