#include <gtest/gtest.h>

#if __has_include(<thrust/sort.h>)
#define STICTION_TEST_HAS_THRUST
#define THRUST_DEVICE_SYSTEM THRUST_DEVICE_SYSTEM_CPP
#include <thrust/execution_policy.h>
#include <thrust/sequence.h>
#include <thrust/sort.h>
#endif

#include "core/plan/islands.hpp"
#include "cuda/emulated/emulated_device.hpp"
#include "tests/support/oracles/plan_integers.hpp"
#include "tests/support/systems/random_structures.hpp"

/// The device scheduler, launched as the GPU launches it: its integers are those of the host's planner and of a library
/// sort.
namespace stiction::test {
namespace {

/// Environments by key, as Thrust's stable sort orders them.
std::vector<Offset> library_order(const std::vector<std::uint8_t>& keys) {
#if defined(STICTION_TEST_HAS_THRUST)
  std::vector<std::uint8_t> sorted = keys;
  std::vector<Offset> order(keys.size());
  thrust::sequence(thrust::host, order.begin(), order.end());
  thrust::stable_sort_by_key(thrust::host, sorted.begin(), sorted.end(), order.begin());
  return order;
#else
  return stable_order(keys);
#endif
}

void plan_on(cuda::EmulatedDevice& device, const ContactBatch<double>& batch, const char* what, bool are_many = false) {
  EXPECT_EQ(difference_of_plans(device, batch, library_order, are_many), "") << what;
}

TEST(DevicePlan, IntegersAreTheHostsOnAThousandRandomBatches) {
  std::mt19937 random(5);
  for (int k = 0; k < 1000 && !::testing::Test::HasFailure(); ++k) {
    cuda::EmulatedDevice device({1 + k % 3, 1 + k % 4, static_cast<std::uint64_t>(k)});
    plan_on(device, random_structures(random), ("batch " + std::to_string(k)).c_str());
  }
}

TEST(DevicePlan, IntegersAreTheHostsOnEveryScene) {
  cuda::EmulatedDevice device({2, 3, 1});
  plan_on(device, ragged_batch(8, 1), "ragged");
  plan_on(device, scene_batch("mixed", 300, 3), "mixed");
  plan_on(device, scene_batch("mixed", 300, 3), "mixed, a lane each", true);
  plan_on(device, scene_batch("pile", 3, 3, 500), "pile");
}

/// Lanes of several groups, whose counters are added up in two steps; and no room for counters in fast memory.
TEST(DevicePlan, IntegersAreTheHostsWhateverTheTeamAndItsFastMemory) {
  std::mt19937 random(7);
  for (int k = 0; k < 20; ++k)
    for (const std::size_t shared : {std::size_t{227} << 10U, std::size_t{16} << 10U}) {
      cuda::EmulatedDevice device({15 + k, 1 + k % 3, static_cast<std::uint64_t>(k), shared});
      plan_on(device, k % 2 == 0 ? random_structures(random) : scene_batch("mixed", 40, 3),
              (std::to_string(15 + k) + " lanes, " + std::to_string(shared) + " bytes").c_str());
    }
}

TEST(DevicePlan, IslandsAreTheHosts) {
  std::mt19937 random(6);
  for (int k = 0; k < 200; ++k) {
    const ContactBatch<double> batch = random_structures(random);
    const Capacity need = Capacity::of(batch.view());
    cuda::EmulatedDevice device({1 + k % 3, 1 + k % 4, static_cast<std::uint64_t>(k)});
    cuda::Engine engine(device);
    engine.reserve(need, SolverKind::pgs, Precision::f32);
    const Islands host = find_islands(batch.view());
    std::vector<Index> island(host.island.size(), -1), count(host.count.size(), -1);
    engine.islands(batch.view(), island.data(), count.data(), nullptr);
    device.synchronize(nullptr);
    EXPECT_EQ(island, host.island);
    EXPECT_EQ(count, host.count);
  }
}

TEST(DevicePlan, IslandsAreFoundThroughTheSolver) {
  const ContactBatch<double> batch = ragged_batch(3, 2);
  const Islands host = find_islands(batch.view());
  ContactBatchView<double> there = batch.view();
  there.space = MemorySpace::cuda;
  for (const Device device : {Device::cpu(), Device::emulated()}) {
    const Solver solver(device, {}, Capacity::of(batch.view()));
    std::vector<Index> island(host.island.size(), -1), count(host.count.size(), -1);
    solver.islands(device.kind == DeviceKind::cpu ? batch.view() : there, island.data(), count.data());
    solver.synchronize();
    EXPECT_EQ(island, host.island);
    EXPECT_EQ(count, host.count);
  }
}

void expect_order(const ClassLimits& limits) {
  int last = kSortKeys;
  SizeClass last_class = SizeClass::trivial;
  for (Index rows = 1; rows <= 1024; ++rows) {
    const SizeClass own = size_class(EnvPath::dense, rows, limits);
    EXPECT_LE(rows, limits.of(own));
    EXPECT_TRUE(limits.holds(own));
    EXPECT_GT(rows, limits.below(own));
    EXPECT_LE(static_cast<int>(own), static_cast<int>(last_class));
    EXPECT_LE(sort_key(own, rows, limits), last) << rows;
    EXPECT_EQ(sort_key(own, rows, limits) / kBucketsPerClass, static_cast<int>(own));
    last = sort_key(own, rows, limits);
    last_class = own;
  }
}

TEST(SizeClasses, KeysOrderClassesAndThenSizes) {
  expect_order(ClassLimits{});
  expect_order(ClassLimits{}.with(SizeClass::thread_large, 72));
  expect_order(ClassLimits{}.from(SizeClass::dense_block));
}

TEST(SizeClasses, ALaneEachTakesTheSizesOfTilesAndWarps) {
  const ClassLimits few, many = few.with(SizeClass::thread_large, 72);
  for (Index rows = 1; rows <= 1024; ++rows) {
    const SizeClass shared_out = size_class(EnvPath::dense, rows, few), own = size_class(EnvPath::dense, rows, many);
    EXPECT_EQ(own, rows > 18 && rows <= 72 ? SizeClass::thread_large : shared_out) << rows;
  }
  EXPECT_FALSE(many.holds(SizeClass::dense_warp));
  EXPECT_FALSE(few.holds(SizeClass::thread_large));
}

TEST(SizeClasses, KeysOrderSizesOfSparseEnvironments) {
  int last = kSortKeys;
  for (Index rows = 65; rows < 2000000; rows = rows * 9 / 8 + 1) {
    const SizeClass own = size_class(EnvPath::sparse, rows);
    EXPECT_LE(sort_key(own, rows), last) << rows;
    EXPECT_EQ(sort_key(own, rows) / kBucketsPerClass, static_cast<int>(own));
    last = sort_key(own, rows);
  }
}

}  // namespace
}  // namespace stiction::test
