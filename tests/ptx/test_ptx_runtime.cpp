#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>

#include "stiction/error.hpp"
#include "tests/ptx/operations.hpp"

/// Tests of the runtime of translated PTX: small kernels (mistakes.ptx), and instructions by NVIDIA's description.
namespace {

using namespace stiction;
using namespace stiction::ptx;

struct Arguments {
  u32* out = nullptr;
  u64 unused = 0;
};

Kernel& kernel(const std::string& name) {
  for (Kernel* const one : kernels())
    if (one->name == name) return *one;
  throw std::runtime_error("no kernel " + name);
}

/// One block of as many threads as CudaApi would give teams of `lanes`.
void launch_teams(const std::string& name, int lanes, u32* out, std::size_t shared_bytes = 0) {
  cuda::EmulatedLaunch launch{};
  launch.shape = {1, lanes, shared_bytes, false};
  const Arguments arguments{out};
  ptx::launch(kernel(name), launch, &arguments);
}

std::string mistake(const std::string& name, int lanes = 128) {
  std::array<u32, 256> out{};  // the awaited number is zero
  try {
    launch_teams(name, lanes, out.data());
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::device_failure);
    return error.what();
  }
  return "no mistake seen";
}

TEST(PtxRuntime, ABlockExchangesThroughSharedMemory) {
  std::array<u32, 128> out{};
  launch_teams("neighbours", 128, out.data(), 512);
  for (u32 i = 0; i < out.size(); ++i) EXPECT_EQ(out[i], i ^ 33U);
}

TEST(PtxRuntime, HalvesOfAWarpExchangeByThemselves) {
  std::array<u32, 128> out{};
  launch_teams("warps", 128, out.data());
  for (u32 i = 0; i < 32; ++i) {
    const u32 first = i / 16 * 16;
    u32 sum = 0, any = 0;
    for (u32 k = first; k < first + 16; ++k) {
      sum += k;
      any |= 2 * k;
    }
    EXPECT_EQ(out[i], (i ^ 1U) * 1000 + sum + any * 1000000) << "lane " << i;
  }
}

TEST(PtxRuntime, AMistakeOfALaneIsAnErrorThatNamesIt) {
  EXPECT_NE(mistake("deadlock").find("waits at a barrier that others never reach"), std::string::npos);
  EXPECT_NE(mistake("outside_mask").find("is not in the mask of its own barrier"), std::string::npos);
  EXPECT_NE(mistake("ended_lane").find("has ended"), std::string::npos) << mistake("ended_lane");
  EXPECT_NE(mistake("other_masks").find("waits at a barrier"), std::string::npos);
  EXPECT_NE(mistake("trapped").find("thread 7 executed a trap"), std::string::npos) << mistake("trapped");
  EXPECT_NE(mistake("spinning").find("waits for what no lane writes"), std::string::npos);
}

TEST(PtxRuntime, MoreThreadsThanAKernelWasCompiledForAreAnError) {
  std::array<u32, 128> out{};
  launch_teams("few_threads", 128, out.data());
  EXPECT_NE(mistake("few_threads", 256).find("256 threads a block and was compiled for 128"), std::string::npos);
}

TEST(PtxRuntime, MoreSharedMemoryThanThereIsIsAnError) {
  EXPECT_THROW(launch_teams("neighbours", 128, nullptr, std::size_t{228} << 10), Error);
}

TEST(PtxRuntimeDeathTest, AddressesThatNoGpuTakesEndTheProcess) {
  std::array<u32, 256> out{};
  EXPECT_DEATH(launch_teams("misaligned", 32, out.data()), "not aligned");
  EXPECT_DEATH(launch_teams("beyond_shared", 32, out.data(), 64), "");
}

TEST(PtxRuntime, AfterAMistakeTheNextLaunchIsSound) {
  EXPECT_NE(mistake("trapped"), "no mistake seen");
  std::array<u32, 128> out{};
  launch_teams("neighbours", 128, out.data(), 512);
  EXPECT_EQ(out[127], 127U ^ 33U);
}

TEST(PtxRuntime, WhatLanesExecuteIsCounted) {
  Kernel& counted = kernel("neighbours");
  const u64 before = counted.instructions;
  std::array<u32, 128> out{};
  launch_teams("neighbours", 128, out.data(), 512);
  EXPECT_EQ(counted.instructions - before, 128U * 15U);
}

TEST(PtxOperations, BitsAreMovedAsDescribed) {
  EXPECT_EQ(insert_bits<u32>(0xAB, 0xFFFFFFFFU, 8, 8), 0xFFFFABFFU);
  EXPECT_EQ(insert_bits<u64>(0x12345678U, 0x9ABCDEF0U, 32, 32), 0x123456789ABCDEF0U);
  EXPECT_EQ(insert_bits<u32>(1, 7, 40, 4), 7U) << "beyond the last bit nothing is inserted";
  EXPECT_EQ(extract_bits<u32>(0xFFFFABFFU, 8, 8), 0xABU);
  EXPECT_EQ(extract_bits<i32>(static_cast<i32>(0xFFFFABFFU), 8, 8), static_cast<i32>(0xFFFFFFABU));
  EXPECT_EQ(permute_bytes<u32>(0x33221100U, 0x77665544U, 0x7604U), 0x77660044U);
  EXPECT_EQ(permute_bytes<u32>(0x000000F0U, 0, 0x8888U), 0xFFFFFFFFU) << "bit 3 of a selector repeats the sign";
  EXPECT_EQ(shift_left<u32>(1, 32), 0U);
  EXPECT_EQ(shift_right<i32>(-8, 100), -1);
  EXPECT_EQ(shift_right<u64>(~u64{0}, 64), 0U);
  EXPECT_EQ(reverse_bits<u32>(1), 0x80000000U);
  EXPECT_EQ(leading_zeros<u32>(0), 32U);
  EXPECT_EQ(high_product<i32>(-2, std::numeric_limits<i32>::max()), -1);
  EXPECT_EQ(high_product<u32>(0x80000001U, 6U), 3U);
  EXPECT_EQ(high_product<i64>(-2, std::numeric_limits<i64>::max()), -1);
  EXPECT_EQ(high_product<i64>(-7, 0x5555555555555556), -3);  // a third, rounded down
  EXPECT_EQ(high_product<u64>(0x8000000000000001U, 6U), 3U);
}

TEST(PtxOperations, NumbersAtTheEndsAreThoseOfTheDescription) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(larger(nan, 2.0F), 2.0F);
  EXPECT_EQ(smaller(3.0F, nan), 3.0F);
  EXPECT_FALSE(std::signbit(larger(-0.0F, 0.0F)));
  EXPECT_TRUE(std::signbit(smaller(0.0F, -0.0F)));
  EXPECT_TRUE(std::signbit(negative(0.0)));
  EXPECT_EQ(truncated<i32>(1e20), std::numeric_limits<i32>::max());
  EXPECT_EQ(truncated<i32>(-2.7F), -2);
  EXPECT_EQ(truncated<u32>(-1.0F), 0U);
  EXPECT_EQ(truncated<i32>(nan), 0);
  EXPECT_EQ(quotient<i32>(std::numeric_limits<i32>::min(), -1), std::numeric_limits<i32>::min());
  EXPECT_EQ(remainder<i32>(std::numeric_limits<i32>::min(), -1), 0);
  EXPECT_FALSE(is_ordered(nan, 1.0F));
}

}  // namespace
