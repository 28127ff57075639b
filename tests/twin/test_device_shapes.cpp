#include <gtest/gtest.h>

#include <map>
#include <string>

#include "core/job/fallback_chain.hpp"
#include "cuda/machine/engine.hpp"
#include "stiction/error.hpp"
#include "tests/support/machines/counting_device.hpp"
#include "tests/support/machines/every_solver.hpp"

/// What launches of the engine ask for, against what GPUs have. One that asks for more fails there whatever the batch,
/// since every class of the capacity is launched.
namespace stiction::test {
namespace {

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

/// Few teams are spread over blocks of a warp each, many share blocks.
TEST(LaunchGrids, NoMultiprocessorIsIdleForTheSakeOfALargerBlock) {
  for (const Gpu& gpu : kGpus) {
    const CountingDevice device(gpu);
    cuda::LaunchShape shape;
    shape.lanes = cuda::kWarp;
    for (const auto& [teams_each, warps] : {std::pair{1, 1}, {2, 2}, {3, 2}, {4, 4}, {50, 4}}) {
      shape.teams = Offset{gpu.processors} * teams_each;
      EXPECT_EQ(cuda::launch_grid(shape, false, device.facts(), nullptr).teams_per_block, warps)
          << gpu.name << ", " << teams_each << " teams a multiprocessor";
    }
  }
}

}  // namespace
}  // namespace stiction::test
