#include <dlfcn.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <map>
#include <sstream>
#include <string>

#include "cuda/emulated/emulated_device.hpp"
#include "stiction/io.hpp"
#include "stiction/solver.hpp"
#include "tests/ptx/lane.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/machines/on_engine.hpp"

/// How much the generated code executes for recorded robots: what makes a kernel slow and shows in no bit.
/// `STICTION_UPDATE_COUNTS=1` writes the table instead.
namespace {

using namespace stiction;
using namespace stiction::test;

constexpr const char* kHead = "batch,compiler,instructions,generic,local,barriers";
constexpr double kAllowed = 0.1;  ///< more than the table says

using Row = std::array<double, 4>;
Row row_of(const ptx::LaneCounts& counts, double envs) {
  return {static_cast<double>(counts.instructions) / envs, static_cast<double>(counts.generic) / envs,
          static_cast<double>(counts.local) / envs, static_cast<double>(counts.barriers) / envs};
}

/// Executed instructions of all lanes for an environment, by npgs in single precision to 1e-4. `by_lanes`: as if there
/// were enough environments for a lane each.
Row count(const std::string& name, bool by_lanes) {
  const auto counts_of = reinterpret_cast<void (*)(const char*, ptx::LaneCounts*)>(
      dlsym(dlopen(std::getenv("STICTION_EMULATED_KERNELS"), RTLD_NOW), "stiction_ptx_counts"));
  const auto batch = convert<float>(io::read_batch(std::string(STICTION_EXAMPLES_DIR) + "/data/" + name + ".h5").batch);
  SolverOptions options;
  options.solver = SolverKind::npgs;
  options.tolerance = 1e-4;
  const auto expected = env_hashes(batch, solve(batch, options));
  cuda::ClassRules rules;
  rules.many_per_processor = by_lanes ? 0 : batch.env_count() + 1;
  cuda::EmulatedDevice device;
  ptx::LaneCounts before, after;
  counts_of("isa_cuda::Npgs", &before);
  const auto answer = on_engine(device, batch, options, rules);
  counts_of("isa_cuda::Npgs", &after);
  EXPECT_EQ(expected, answer) << name;
  after.instructions -= before.instructions;
  after.generic -= before.generic;
  after.local -= before.local;
  after.barriers -= before.barriers;
  return row_of(after, static_cast<double>(batch.env_count()));
}

std::map<std::string, std::pair<std::string, Row>> table() {
  std::map<std::string, std::pair<std::string, Row>> rows;
  std::ifstream file(STICTION_PTX_COUNTS);
  std::string line;
  std::getline(file, line);
  EXPECT_EQ(line, kHead);
  while (std::getline(file, line)) {
    std::istringstream fields(line);
    std::string name, compiler, number;
    std::getline(fields, name, ',');
    std::getline(fields, compiler, ',');
    Row row{};
    for (double& value : row) {
      std::getline(fields, number, ',');
      value = std::stod(number);
    }
    rows[name] = {compiler, row};
  }
  return rows;
}

TEST(PtxCounts, RecordedRobotsExecuteNoMoreThanTheyDid) {
  if (std::getenv("STICTION_EMULATED_KERNELS") == nullptr) GTEST_SKIP() << "no kernels are named to execute";
  const bool updates = std::getenv("STICTION_UPDATE_COUNTS") != nullptr;
  const auto rows = table();
  std::ostringstream written;
  written << kHead << "\n";
  for (const auto& [robot, by_lanes] : {std::pair{"hand_cube", false},
                                        {"humanoid", false},
                                        {"quadruped_rough", false},
                                        {"hand_cube", true},
                                        {"humanoid", true},
                                        {"quadruped_rough", true}}) {
    const std::string name = robot + std::string(by_lanes ? ": a lane each" : "");
    const Row found = count(robot, by_lanes);
    written << name << "," << STICTION_CUDA_COMPILER;
    for (const double value : found) written << "," << std::llround(value);
    written << "\n";
    if (updates) continue;
    ASSERT_TRUE(rows.count(name) > 0) << name;
    const auto& [compiler, allowed] = rows.at(name);
    if (compiler != STICTION_CUDA_COMPILER) GTEST_SKIP() << "counted with nvcc " << compiler;
    for (std::size_t k = 0; k < found.size(); ++k)
      EXPECT_LE(found[k], (1 + kAllowed) * allowed[k] + 1) << name << ", column " << k + 2;
  }
  std::printf("%s", written.str().c_str());
  if (updates) std::ofstream(STICTION_PTX_COUNTS) << written.str();
}

}  // namespace
