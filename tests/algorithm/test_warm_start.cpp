#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <random>
#include <vector>

#include "core/algorithm/warm_start/warm_start.hpp"
#include "tests/support/machines/stress_team.hpp"

namespace stiction::test {
namespace {

constexpr Index kWidths[] = {1, 2, 3, 8, 33};

/// Runs f(team) on lanes that disagree about speed.
template <class F>
void run_dawdling(Index width, std::uint64_t seed, F&& f) {
  run_stressed(width, f, seed);
}

TEST(Sort, IsWhatTheStandardLibraryMakesOfEveryLengthAndOrder) {
  std::mt19937_64 random(1);
  const auto ascending = [](std::uint64_t a, std::uint64_t b) { return a < b; };
  for (Index n = 0; n <= 130; ++n) {
    for (int trial = 0; trial < 8; ++trial) {
      std::vector<std::uint64_t> values(static_cast<std::size_t>(n));
      for (auto& value : values) value = random();
      if (trial == 1) std::sort(values.begin(), values.end());
      if (trial == 2) std::sort(values.rbegin(), values.rend());
      std::vector<std::uint64_t> expected = values;
      std::sort(expected.begin(), expected.end());
      SerialTeam team;
      sort_network(team, n, values.data(), ascending);
      ASSERT_EQ(values, expected) << "length " << n;
    }
  }
}

/// By the 0-1 principle a network that sorts every sequence of zeros and ones sorts everything. Ties among zeros are
/// broken by place, which a network of comparators does not distinguish from a strict order.
TEST(Sort, SortsEverySequenceOfZerosAndOnesUpToLength14) {
  for (Index n = 1; n <= 14; ++n) {
    for (std::uint32_t pattern = 0; pattern < (1U << n); ++pattern) {
      std::vector<std::uint32_t> values(static_cast<std::size_t>(n));
      for (Index i = 0; i < n; ++i) values[static_cast<std::size_t>(i)] = (pattern >> i) & 1U;
      SerialTeam team;
      sort_network(team, n, values.data(), [](std::uint32_t a, std::uint32_t b) { return a < b; });
      ASSERT_TRUE(std::is_sorted(values.begin(), values.end())) << "length " << n << ", pattern " << pattern;
    }
  }
}

TEST(Sort, DoesNotDependOnHowManyLanesThereAre) {
  std::mt19937_64 random(2);
  for (const Index width : kWidths) {
    for (const Index n : {1, 2, 31, 32, 33, 100}) {
      std::vector<std::uint64_t> values(static_cast<std::size_t>(n));
      for (auto& value : values) value = random();
      std::vector<std::uint64_t> expected = values;
      std::sort(expected.begin(), expected.end());
      run_dawdling(width, 5, [&](auto& team) {
        sort_network(team, n, values.data(), [](std::uint64_t a, std::uint64_t b) { return a < b; });
      });
      EXPECT_EQ(values, expected) << "width " << width << ", length " << n;
    }
  }
}

TEST(Sort, FindsTheFirstOfEqualsAndTheEnd) {
  const int values[] = {1, 3, 3, 3, 7};
  const auto before = [](int a, int b) { return a < b; };
  EXPECT_EQ(lower_bound(values, 5, 0, before), 0);
  EXPECT_EQ(lower_bound(values, 5, 3, before), 1);
  EXPECT_EQ(lower_bound(values, 5, 4, before), 4);
  EXPECT_EQ(lower_bound(values, 5, 7, before), 4);
  EXPECT_EQ(lower_bound(values, 5, 8, before), 5);
  EXPECT_EQ(lower_bound(values, 0, 8, before), 0);
}

/// Cones of one environment behind another one's, so that first cone and row are not 0.
struct Cones {
  explicit Cones(std::uint64_t seed, Index count) {
    std::mt19937_64 random(seed);
    for (Index c = 0; c < count; ++c) {
      id.push_back(random() % 3 == 0 ? ~std::uint64_t{0} - random() % 20 : random() % 150);
      kind.push_back(random() % 4 == 0 ? ConeKind::box : ConeKind::friction);
      offsets.push_back(offsets.back() + (kind.back() == ConeKind::box ? 1 : 3));
    }
    env_cone[2] = env_cone[1] + count;
    env_row[2] = offsets.back();
    lambda.resize(static_cast<std::size_t>(env_row[2]));
    for (auto& value : lambda) value = static_cast<float>(random() % 1000) - 500.0F;
  }
  [[nodiscard]] ContactBatchView<float> view() const {
    ContactBatchView<float> batch;
    batch.env_count = 2;
    batch.cone_count = env_cone[2];
    batch.row_count = env_row[2];
    batch.env_row_offsets = env_row;
    batch.env_cone_offsets = env_cone;
    batch.cone_kind = kind.data();
    batch.cone_row_offsets = offsets.data();
    return batch;
  }
  std::vector<std::uint64_t> id{7};
  std::vector<ConeKind> kind{ConeKind::friction};
  std::vector<Offset> offsets{0, 4};
  std::vector<float> lambda;
  Offset env_row[3] = {0, 4, 4};
  Offset env_cone[3] = {0, 1, 1};
};

/// A store's memory outside of any machine.
struct Memory {
  std::vector<WarmStartSlot> slot{2};
  std::vector<WarmStartRecord> record{2};
  std::vector<WarmStartEntry> stored{300}, sorting{300};
  std::vector<float> lambda = std::vector<float>(900);
  WarmStartMemory<float> view() {
    return {2, 300, 900, slot.data(), record.data(), stored.data(), sorting.data(), lambda.data()};
  }
};

template <class T>
bool same_bytes(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0;
}

TEST(WarmStart, LanesOfEveryNumberAndSpeedLeaveTheSameBytes) {
  const Cones before(3, 120);
  const Cones now(4, 140);
  const std::vector<EnvStatus> status(2);
  const auto step = [&](auto& team, Memory& memory, std::vector<float>& guess) {
    store_warm_start(team,
                     WarmStartStoreJob<float>{memory.view(), before.view(), before.id.data(), before.lambda.data(),
                                              status.data(), 0.01},
                     Offset{1});
    load_warm_start(
        team,
        WarmStartLoadJob<float>{memory.view(), now.view(), now.id.data(), guess.data(), 0.02, 0.9, StepScaling::capped},
        Offset{1});
  };
  Memory expected;
  std::vector<float> expected_guess(static_cast<std::size_t>(now.env_row[2]), 77.0F);
  SerialTeam serial;
  step(serial, expected, expected_guess);
  EXPECT_GT(expected.record[1].hits, 10);
  EXPECT_GT(expected.record[1].misses, 10);
  EXPECT_EQ(expected.record[1].flags, kWarmStartDuplicateId);
  EXPECT_EQ(expected_guess[3], 77.0F) << "the environment before was written";
  for (const Index width : kWidths) {
    Memory memory;
    std::vector<float> guess(expected_guess.size(), 77.0F);
    run_dawdling(width, 11, [&](auto& team) { step(team, memory, guess); });
    EXPECT_TRUE(same_bytes(guess, expected_guess)) << "width " << width;
    EXPECT_TRUE(same_bytes(memory.slot, expected.slot)) << "width " << width;
    EXPECT_TRUE(same_bytes(memory.record, expected.record)) << "width " << width;
    EXPECT_TRUE(same_bytes(memory.stored, expected.stored)) << "width " << width;
    EXPECT_TRUE(same_bytes(memory.lambda, expected.lambda)) << "width " << width;
  }
}

TEST(WarmStart, TheFactorOfAChangedStepIsThePrintedFormula) {
  EXPECT_EQ(carry_factor<double>(0.5, StepScaling::capped, 0.01, 0.04), 0.5 * 0.25);
  EXPECT_EQ(carry_factor<double>(0.5, StepScaling::capped, 0.04, 0.01), 0.5);
  EXPECT_EQ(carry_factor<double>(0.5, StepScaling::none, 0.04, 0.01), 0.5);
  EXPECT_EQ(carry_factor<double>(0.5, StepScaling::proportional, 0.04, 0.01), 0.5 * 0.25);
  EXPECT_EQ(carry_factor<double>(0.5, StepScaling::proportional, 0.01, 0.04), 0.5 * 4.0);
  EXPECT_EQ(carry_factor<float>(1.0, StepScaling::proportional, 1e-30, 1e30), 0.0F) << "what overflows carries nothing";
}

}  // namespace
}  // namespace stiction::test
