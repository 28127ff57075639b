#include <gtest/gtest.h>

#if __has_include(<thrust/sort.h>)
#define STICTION_TEST_HAS_THRUST
#define THRUST_DEVICE_SYSTEM THRUST_DEVICE_SYSTEM_CPP
#include <thrust/execution_policy.h>
#include <thrust/sequence.h>
#include <thrust/sort.h>
#endif

#include "core/plan/islands.hpp"
#include "core/plan/plan.hpp"
#include "core/plan/structure_view.hpp"
#include "cuda/emulated/emulated_device.hpp"
#include "cuda/machine/engine.hpp"
#include "tests/support/device_batch.hpp"
#include "tests/support/random_structures.hpp"

/// The device scheduler, launched as the GPU launches it: its integers are those of the host's planner and of a library
/// sort.
namespace stiction::test {
namespace {

/// A device's array on the host. The emulated device's memory is the host's.
template <class T>
std::vector<T> array_of(const T* data, Offset count) {
  return {data, data + count};
}

template <class T>
std::vector<T> slice_of(const std::vector<T>& all, Offset begin, Offset count) {
  return {all.begin() + begin, all.begin() + begin + count};
}

/// Environments by key, as Thrust's stable sort orders them.
std::vector<Offset> library_order(std::vector<std::uint8_t> keys) {
  std::vector<Offset> order(keys.size());
#if defined(STICTION_TEST_HAS_THRUST)
  thrust::sequence(thrust::host, order.begin(), order.end());
  thrust::stable_sort_by_key(thrust::host, keys.begin(), keys.end(), order.begin());
#else
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<Offset>(i);
  std::stable_sort(order.begin(), order.end(), [&](Offset a, Offset b) {
    return keys[static_cast<std::size_t>(a)] < keys[static_cast<std::size_t>(b)];
  });
#endif
  return order;
}

void expect_hosts_integers(const ContactBatch<double>& batch, const cuda::PlanArrays& device,
                           const ClassLimits& limits) {
  const ContactBatchView<double> view = batch.view();
  const PlanData host = make_plan(view);
  const Offset envs = view.env_count;
  EXPECT_EQ(array_of(device.path, envs), host.path);
  EXPECT_EQ(array_of(device.counts, envs), host.counts);
  EXPECT_EQ(array_of(device.color_count, envs), host.color_count);
  EXPECT_EQ(array_of(device.cone_order, view.cone_count), host.cone_order);
  std::vector<std::uint8_t> keys;
  std::vector<Offset> class_begin(kSizeClasses + 1, 0);
  for (Offset env = 0; env < envs; ++env) {
    const auto index = static_cast<std::size_t>(env);
    EXPECT_EQ(device.flags[env], 0U);
    const SizeClass expected = size_class(host.path[index], view.env_rows(env), limits);
    keys.push_back(static_cast<std::uint8_t>(sort_key(expected, view.env_rows(env), limits)));
    ++class_begin[static_cast<std::size_t>(expected) + 1];
    if (host.path[index] != EnvPath::sparse) continue;
    const Offset first = device.env_vertex_offsets[env];
    const Offset vertices = host.env_vertex_offsets[index + 1] - host.env_vertex_offsets[index];
    const Offset colors = host.env_color_offsets[index + 1] - host.env_color_offsets[index];
    EXPECT_EQ(array_of(device.vertex_offsets + first, vertices),
              slice_of(host.vertex_offsets, host.env_vertex_offsets[index], vertices));
    EXPECT_EQ(array_of(device.color_offsets + first, colors),
              slice_of(host.color_offsets, host.env_color_offsets[index], colors));
  }
  for (int k = 0; k < kSizeClasses; ++k)
    class_begin[static_cast<std::size_t>(k) + 1] += class_begin[static_cast<std::size_t>(k)];
  EXPECT_EQ(array_of(device.key, envs), keys);
  EXPECT_EQ(array_of(device.class_begin, kSizeClasses + 1), class_begin);
  EXPECT_EQ(array_of(device.order, envs), library_order(keys));
}

/// Plans and solves nothing: no iteration is allowed.
void plan_on(cuda::EmulatedDevice& device, const ContactBatch<double>& batch, const char* what, bool are_many = false) {
  SCOPED_TRACE(what);
  cuda::ClassRules rules;
  rules.many_per_processor = are_many ? 0 : batch.view().env_count + 1;
  SolverOptions options;
  options.max_iterations = 0;
  const Capacity need = Capacity::of(batch.view());
  cuda::Engine engine(device, rules);
  engine.reserve(need, options.solver, Precision::f64);
  const cuda::Stream stream(device);
  DeviceBatch<double> there(device, need);
  there.fill(batch, stream.get());
  engine.solve(SolveRequest<double>{nullptr, there.view(), there.solution(), nullptr, batch.law(), options,
                                    StreamRef(stream.get())});
  device.synchronize(stream.get());
  const ClassLimits limits;
  expect_hosts_integers(batch, engine.plan_arrays(), are_many ? limits.with(SizeClass::thread_large, 72) : limits);
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
    engine.islands(structure_view(batch.view()), island.data(), count.data(), nullptr);
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
