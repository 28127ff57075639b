#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <memory>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "cuda/machine/jacobian_machine.hpp"
#include "tests/support/count_table.hpp"
#include "tests/support/machines/counting_device.hpp"

/// Share of a GPU that a batch of recorded robots keeps at work. Nothing is executed: it follows from shapes, memory
/// and registers. `STICTION_UPDATE_COUNTS=1` writes the table instead.
namespace stiction::test {
namespace {

constexpr const char* kHead = "launched,blocks,warps a multiprocessor";
constexpr const char* kTable = STICTION_EXAMPLES_DIR "/../tests/twin/occupancy.csv";

/// A kernel whose launches are looked at.
struct Launched {
  const char* name;     ///< as the machine calls it
  const char* program;  ///< as the table of machine code calls it (cuda/native/solver_budget.csv)
  bool must_fill;       ///< a block a multiprocessor at least, from 2048 environments on
};
constexpr Launched kLaunched[] = {{"velocity_newton", "SolveVelocityTeams<float, float>", true},
                                  {"velocity_newton_by_lanes", "SolveVelocities<float, float, false>", false}};

/// The largest of the recorded environments (tests/ptx/robots).
struct Robot {
  const char* name;
  Index rows, cones, dofs;
};
constexpr Robot kRobots[] = {
    {"g1", 54, 38, 35}, {"humanoid", 20, 10, 27}, {"go1", 29, 19, 18}, {"leap_hand", 40, 24, 22}};

/// Registers of a thread, by program.
std::map<std::string, int> registers() {
  std::map<std::string, int> all;
  std::ifstream file(STICTION_EXAMPLES_DIR "/../cuda/native/solver_budget.csv");
  for (std::string line; std::getline(file, line);) {
    const std::size_t end = line.find("\",");
    if (line.empty() || line[0] != '"' || end == std::string::npos) continue;
    std::istringstream fields(line.substr(end + 2));
    std::string architecture, number;
    std::getline(fields, architecture, ',');
    std::getline(fields, number, ',');
    all[line.substr(1, end - 1)] = std::stoi(number);
  }
  return all;
}

/// Blocks that a multiprocessor runs at once.
Offset resident_blocks(const Gpu& gpu, const cuda::LaunchGrid& grid, int registers) {
  constexpr std::size_t kReserved = 1024;              // shared memory of each block that the system keeps [bytes]
  constexpr int kRegisters = 65536, kMostBlocks = 24;  // of a multiprocessor; the fewest of these three GPUs
  const int warps = grid.block / cuda::kWarp, own = (registers + 7) / 8 * 8;
  const auto by_memory = static_cast<int>((gpu.processor << 10U) / (grid.shared + kReserved));
  return std::min({gpu.warps / warps, by_memory, kRegisters / (own * grid.block), kMostBlocks});
}

struct Occupancy {
  Offset blocks = 0;  ///< of a launch
  double warps = 0;   ///< on a multiprocessor, on average over all
};

/// Shapes of the first launches of `auto` on J and M, by name.
std::map<std::string, cuda::LaunchShape> shapes_of(const Gpu& gpu, const Robot& robot, Offset envs) {
  const JacobianCapacity capacity = JacobianCapacity::of_largest(envs, robot.rows, robot.cones, robot.dofs);
  const auto device = std::make_shared<CountingDevice>(gpu);
  cuda::DeviceJacobianMachine<float> machine(device, capacity, FactorUse::by_size, true);
  VelocityJob<float> job;
  job.batch.env_count = envs;
  job.tolerance = 1e-4;
  machine.solve_velocities(job, StreamRef::default_stream());
  return device->shapes;
}

TEST(Occupancy, ABatchKeepsNoLessOfAGpuAtWorkThanItDid) {
  CountTable table(kTable, kHead);
  const std::map<std::string, int> machine_code = registers();
  for (const Robot& robot : kRobots)
    for (const Gpu& gpu : kGpus)
      for (const Offset envs : {2048, 8192, 65536}) {
        const auto shapes = shapes_of(gpu, robot, envs);
        const bool are_many = envs >= cuda::VelocityRules{}.many_per_processor * gpu.processors;
        EXPECT_EQ(shapes.count("velocity_newton"), are_many ? 0U : 1U);
        EXPECT_EQ(shapes.count("velocity_newton_by_lanes"), are_many ? 1U : 0U);
        for (const Launched& launched : kLaunched) {
          if (shapes.count(launched.name) == 0) continue;  // teams have few environments, a lane each many
          const std::string name =
              std::string(robot.name) + ": " + launched.name + " " + gpu.name + " " + std::to_string(envs);
          const CountingDevice device(gpu);
          const cuda::LaunchGrid grid = cuda::launch_grid(shapes.at(launched.name), false, device.facts(), nullptr);
          const Offset resident = resident_blocks(gpu, grid, machine_code.at(launched.program));
          EXPECT_GT(resident, 0) << name;
          Occupancy found;
          found.blocks = cuda::blocks_of(shapes.at(launched.name), grid, gpu.processors * resident);
          found.warps = static_cast<double>(found.blocks * grid.block / cuda::kWarp) / gpu.processors;
          if (launched.must_fill) {
            EXPECT_GE(found.blocks, gpu.processors) << name;
          }
          char fields[40];
          std::snprintf(fields, sizeof(fields), "%lld,%.2f", static_cast<long long>(found.blocks), found.warps);
          const std::vector<std::string> allowed = table.add(name, fields);
          if (allowed.empty()) continue;
          ASSERT_EQ(allowed.size(), 2U) << name;
          EXPECT_GE(found.blocks, std::stoll(allowed[0])) << name;
          EXPECT_GE(found.warps, std::stod(allowed[1]) - 0.005) << name;
        }
      }
}

}  // namespace
}  // namespace stiction::test
