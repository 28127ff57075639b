#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <tuple>

#include "core/job/fallback_chain.hpp"
#include "cuda/emulated/emulated_device.hpp"
#include "cuda/machine/engine.hpp"
#include "cuda/native/launch_grid.hpp"
#include "stiction/error.hpp"
#include "tests/support/machines/device_batch.hpp"
#include "tests/support/machines/every_solver.hpp"

/// What launches of the engine ask for, against what GPUs have. One that asks for more fails there whatever the batch,
/// since every class of the capacity is launched.
namespace stiction::test {
namespace {

/// Fast memory of a block and of a multiprocessor [KiB]: of an H200, an A100, an RTX 4090.
struct Gpu {
  const char* name;
  std::size_t block, processor;
};
constexpr Gpu kGpus[] = {{"H200", 227, 228}, {"A100", 163, 164}, {"RTX 4090", 99, 100}};

/// Queues nothing, and looks at what it is to launch.
class CountingDevice final : public cuda::DeviceApi {
 public:
  explicit CountingDevice(const Gpu& gpu) : gpu_(gpu) {
    facts_ = {gpu.name, 132, gpu.block << 10U, gpu.processor << 10U};
  }
  [[nodiscard]] const cuda::DeviceFacts& facts() const override { return facts_; }
  [[nodiscard]] const cuda::KernelCatalogue& kernels() const override { return emulated_.kernels(); }
  void* allocate(std::size_t) override { return this; }
  void release(void*) noexcept override {}
  void* allocate_pinned(std::size_t) override { return this; }
  void release_pinned(void*) noexcept override {}
  cuda::StreamHandle create_stream() override { return this; }
  void destroy_stream(cuda::StreamHandle) noexcept override {}
  cuda::EventHandle create_event(cuda::EventUse) override { return this; }
  void destroy_event(cuda::EventHandle) noexcept override {}
  void copy(void*, const void*, std::size_t, cuda::CopyKind, cuda::StreamHandle) override {}
  void fill_zero(void*, std::size_t, cuda::StreamHandle) override { ++fills; }
  void prepare(const cuda::KernelRef& kernel, const cuda::LaunchShape& shape) override {
    ASSERT_NE(kernel.entry, nullptr) << kernel.name;
    prepared.insert(what_counts(kernel, shape));
  }
  void launch(const cuda::KernelRef& kernel, const cuda::LaunchShape& shape, const void*, cuda::StreamHandle) override {
    ++launches;
    EXPECT_EQ(prepared.count(what_counts(kernel, shape)), 1U) << kernel.name << " could not be captured";
    std::size_t& most = shared[kernel.entry];
    most = std::max(most, shape.shared_bytes);
    const cuda::LaunchGrid grid = cuda::launch_grid(shape, shape.lanes == 1, facts_, nullptr);
    EXPECT_LE(grid.shared, facts_.shared_bytes) << kernel.name << ", " << shape.lanes << " lanes, " << gpu_.name;
    EXPECT_EQ(grid.block % cuda::kWarp, 0);
    EXPECT_LE(grid.block, cuda::kMostLanes);
  }
  void record(cuda::EventHandle, cuda::StreamHandle) override {}
  void wait(cuda::StreamHandle, cuda::EventHandle) override {}
  bool capturing(cuda::StreamHandle) override { return false; }
  void synchronize(cuda::StreamHandle) override {}
  void await(cuda::EventHandle) override {}
  std::optional<double> microseconds(cuda::EventHandle, cuda::EventHandle) override { return std::nullopt; }

  int launches = 0;
  int fills = 0;
  std::set<std::tuple<const void*, int, std::size_t, bool>> prepared;
  std::map<const void*, std::size_t> shared;  ///< most fast memory that teams of a kernel asked for [byte]

 private:
  static std::tuple<const void*, int, std::size_t, bool> what_counts(const cuda::KernelRef& kernel,
                                                                     const cuda::LaunchShape& shape) {
    return {kernel.entry, shape.lanes, shape.shared_bytes, shape.whole_device};
  }

  Gpu gpu_;
  cuda::DeviceFacts facts_;
  cuda::EmulatedDevice emulated_;  ///< has a catalogue of kernels
};

/// Queues a solve of 8192 environments under each law.
template <class Real>
void queue_solves(CountingDevice& device, SolverKind solver, Index rows, Index dofs) {
  Capacity capacity;
  capacity.envs = 8192;
  capacity.rows = capacity.cones = capacity.envs * rows;
  capacity.env_rows = rows;
  capacity.env_nonzeros = Offset{rows} * rows;
  capacity.nonzeros = capacity.envs * capacity.env_nonzeros;
  capacity.env_dofs = dofs;
  cuda::Engine engine(device);
  engine.reserve(capacity, solver, sizeof(Real) == sizeof(float) ? Precision::f32 : Precision::f64);
  ContactBatchView<Real> batch;
  batch.env_count = capacity.envs;
  SolverOptions options;
  options.solver = solver;
  for (const Law law : kBothLaws)
    engine.solve(SolveRequest<Real>{nullptr, batch, {}, nullptr, law, options, StreamRef::default_stream()});
}

template <class Real>
void expect_that_all_fits(const Gpu& gpu, SolverKind solver, Index rows, Index dofs) {
  CountingDevice device(gpu);
  queue_solves<Real>(device, solver, rows, dofs);
  EXPECT_GT(device.launches, 2);
}

TEST(DeviceShapes, NoLaunchAsksForMoreSharedMemoryThanThereIs) {
  for (const Gpu& gpu : kGpus)
    for (const SolverKind solver : kEveryChoice)
      for (Index rows = 1; rows <= 1024; rows += rows < 80 ? 1 : 59)
        for (const Index dofs : {0, 35}) {
          SCOPED_TRACE(std::string(gpu.name) + ", " + label(solver, Law::convex) + ", " + std::to_string(rows) +
                       " rows");
          expect_that_all_fits<float>(gpu, solver, rows, dofs);
          expect_that_all_fits<double>(gpu, solver, rows, dofs);
          if (HasFailure()) return;
        }
}

TEST(DeviceShapes, MoreEnvironmentsThanTheSortCountsAreRefused) {
  CountingDevice device(kGpus[0]);
  cuda::Engine engine(device);
  Capacity capacity;
  capacity.envs = (Offset{1} << 31) - 1;
  capacity.env_rows = 3;
  engine.reserve(capacity, SolverKind::npgs, Precision::f32);
  ++capacity.envs;
  EXPECT_THROW(engine.reserve(capacity, SolverKind::npgs, Precision::f32), Error);
}

/// A stage needs less than the largest of all. Asking for as much would leave room for fewer teams at once.
TEST(DeviceShapes, AStageOfTheFallbackChainAsksForNoMoreThanItsSolverDoesAlone) {
  for (const Index rows : {12, 25, 42, 56, 72, 160}) {
    SCOPED_TRACE(std::to_string(rows) + " rows");
    CountingDevice chain(kGpus[0]);
    queue_solves<float>(chain, SolverKind::automatic, rows, 0);
    int kernels = 0;
    for (const SolverKind solver : kEverySolver) {
      CountingDevice alone(kGpus[0]);
      queue_solves<float>(alone, solver, rows, 0);
      for (const auto& [kernel, bytes] : alone.shared) {
        if (chain.shared.count(kernel) == 0) continue;
        ++kernels;
        EXPECT_EQ(chain.shared.at(kernel), bytes) << to_string(solver);
      }
    }
    EXPECT_GT(kernels, 4);
  }
}

/// Counted by hand, of each law: two to plan, one for trivial environments, one to look at all, one before each of
/// eight stages. In the first one the smallest have a lane each, in two classes by size. All others have teams.
TEST(DeviceShapes, TheFallbackChainQueuesOneLaunchAStageBesideItsClasses) {
  const std::map<Index, int> classes_by_rows = {{12, 1 + 7}, {18, 2 + 7}, {25, 3 + 7}, {42, 4 + 7 * 2}};
  for (const auto& [rows, classes] : classes_by_rows) {
    SCOPED_TRACE(std::to_string(rows) + " rows");
    CountingDevice device(kGpus[0]);
    queue_solves<float>(device, SolverKind::automatic, rows, 0);
    EXPECT_EQ(device.launches, 2 * (2 + 1 + 1 + kFallbackStages + classes));
    EXPECT_EQ(device.fills, 0);
  }
}

/// Counted by hand, of each law: one sort, and of teams four classes of dense environments and one of sparse ones.
TEST(DeviceShapes, GradientsComeEarlyOnlyWhereAnEnvironmentMayBeLargeEnough) {
  std::map<Index, int> launches;
  for (const Index rows : {242, 243}) {
    CountingDevice device(kGpus[0]);
    queue_solves<float>(device, SolverKind::automatic, rows, 0);
    launches[rows] = device.launches;
  }
  EXPECT_EQ(launches[243] - launches[242], 2 * (1 + 5));
}

/// A block's barrier is for all of its threads: two teams that wait by it wait for each other.
TEST(LaunchGrids, ATeamOfMoreThanAWarpHasItsBlockToItself) {
  for (const Gpu& gpu : kGpus) {
    const CountingDevice device(gpu);
    for (int lanes = 1; lanes <= cuda::kMostLanes; lanes *= 2) {
      cuda::LaunchShape shape;
      shape.teams = 1000;
      shape.lanes = lanes;
      const cuda::LaunchGrid grid = cuda::launch_grid(shape, false, device.facts(), nullptr);
      EXPECT_EQ(grid.teams_per_block * lanes, grid.block) << gpu.name << ", " << lanes << " lanes";
      if (lanes > cuda::kWarp) {
        EXPECT_EQ(grid.teams_per_block, 1) << gpu.name << ", " << lanes << " lanes";
      }
    }
  }
}

}  // namespace
}  // namespace stiction::test
