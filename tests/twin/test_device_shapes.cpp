#include <gtest/gtest.h>

#include <map>
#include <string>

#include "core/job/fallback_chain.hpp"
#include "cuda/machine/engine.hpp"
#include "stiction/error.hpp"
#include "tests/support/machines/counting_device.hpp"
#include "tests/support/machines/device_jacobians.hpp"
#include "tests/support/machines/every_solver.hpp"

/// Launches of the engine, against the limits of GPUs. One that asks for more fails there whatever the batch, since
/// every class of the capacity is launched.
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

/// Launches of a solve of J and M by `auto`, of as many environments as there is room for.
std::shared_ptr<CountingDevice> queue_jacobians(Offset envs, Index rows, Index dofs, double tolerance, bool captured) {
  const auto device = std::make_shared<CountingDevice>(kGpus[0]);
  device->is_capturing = captured;
  const JacobianCapacity capacity = JacobianCapacity::of_largest(envs, rows, rows, dofs);
  SolverOptions options;
  options.solver = SolverKind::automatic;
  options.tolerance = tolerance;
  Machine<float> machine(device, capacity, FactorUse::by_size, options);
  JacobianBatchView<float> batch;
  batch.env_count = envs;
  batch.space = MemorySpace::cuda;
  machine.solve(batch, {}, StreamRef::default_stream());
  return device;
}

/// Counted by hand, for the work behind no condition: Newton's method in velocities has one to four launches here. One
/// counts environments before it, and one looks for its leftovers. One sets the condition, and one writes.
TEST(DeviceShapes, AGraphOfASolvedBatchOfJacobiansHasFewLaunches) {
  for (const auto& [rows, dofs] : {std::pair{42, 35}, {12, 27}, {19, 18}, {29, 22}})
    for (const Offset envs : {1024, 4096, 16384})
      for (const double tolerance : {1e-4, 1e-6}) {
        SCOPED_TRACE(std::to_string(rows) + " rows, " + std::to_string(dofs) + " degrees of freedom, " +
                     std::to_string(envs) + " environments, " + std::to_string(tolerance));
        const auto captured = queue_jacobians(envs, rows, dofs, tolerance, true);
        const auto queued = queue_jacobians(envs, rows, dofs, tolerance, false);
        EXPECT_EQ(captured->conditions, 1);
        EXPECT_LE(captured->launches + captured->conditions, tolerance < 1e-5 ? 8 : 6);
        EXPECT_EQ(captured->launches - 1 + captured->conditional_launches, queued->launches)
            << "all but the one that looks for what is left";
        EXPECT_GT(captured->conditional_launches, 20);
        EXPECT_EQ(queued->conditional_launches, 0);
      }
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
