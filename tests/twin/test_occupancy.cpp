#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <map>
#include <memory>
#include <sstream>
#include <string>
#include <utility>

#include "cuda/machine/jacobian_machine.hpp"
#include "tests/support/machines/counting_device.hpp"

/// How much of a GPU a batch of recorded robots keeps at work. Nothing is executed: it follows from shapes, memory and
/// registers. `STICTION_UPDATE_COUNTS=1` writes the table instead.
namespace stiction::test {
namespace {

constexpr const char* kHead = "launched,blocks,warps a multiprocessor";
constexpr const char* kTable = STICTION_EXAMPLES_DIR "/../tests/twin/occupancy.csv";

/// What a launch is of.
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

/// Of what `auto` on J and M launches first, by name.
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

std::map<std::string, Occupancy> table() {
  std::map<std::string, Occupancy> rows;
  std::ifstream file(kTable);
  std::string line;
  std::getline(file, line);
  EXPECT_EQ(line, kHead);
  while (std::getline(file, line)) {
    std::istringstream fields(line);
    std::string name, blocks, warps;
    std::getline(fields, name, ',');
    std::getline(fields, blocks, ',');
    std::getline(fields, warps, ',');
    rows[name] = {std::stoll(blocks), std::stod(warps)};
  }
  return rows;
}

TEST(Occupancy, ABatchKeepsNoLessOfAGpuAtWorkThanItDid) {
  const bool updates = std::getenv("STICTION_UPDATE_COUNTS") != nullptr;
  const std::map<std::string, int> machine_code = registers();
  const auto allowed = updates ? std::map<std::string, Occupancy>{} : table();
  std::ostringstream written;
  written << kHead << "\n";
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
          char line[160];
          std::snprintf(line, sizeof(line), "%s,%lld,%.2f\n", name.c_str(), static_cast<long long>(found.blocks),
                        found.warps);
          written << line;
          if (launched.must_fill) {
            EXPECT_GE(found.blocks, gpu.processors) << name;
          }
          if (updates) continue;
          ASSERT_EQ(allowed.count(name), 1U) << name;
          EXPECT_GE(found.blocks, allowed.at(name).blocks) << name;
          EXPECT_GE(found.warps, allowed.at(name).warps - 0.005) << name;
        }
      }
  if (updates) std::ofstream(kTable) << written.str();
}

}  // namespace
}  // namespace stiction::test
