#include <cxxabi.h>
#include <dlfcn.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <memory>
#include <regex>
#include <string>

#include "stiction/articulated.hpp"
#include "stiction/io.hpp"
#include "stiction/solver.hpp"
#include "tests/ptx/counted_places.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/count_table.hpp"
#include "tests/support/machines/device_jacobians.hpp"
#include "tests/support/machines/on_engine.hpp"
#include "tests/support/systems/derivative_cases.hpp"
#include "tests/support/systems/humanoid.hpp"
#include "tests/support/systems/jacobian_cotangents.hpp"
#include "tests/support/systems/rough_ground.hpp"
#include "tests/support/systems/walker_states.hpp"

/// Instructions and sectors of a GPU's warps for recorded robots: costs of a kernel that show in no bit. A warp has 32
/// different environments, or teams of its lanes have one each. `STICTION_UPDATE_COUNTS=1` writes the table instead.
namespace stiction::test {
namespace {

using ptx::Issued;
using ptx::Memory;
using ptx::TracedLaunch;

constexpr const char* kHead = "counted,compiler,issued,lanes,scratch,lists,input,output,stack,shared,barriers";
constexpr double kAllowed = 0.1;  ///< more than the table's
constexpr double kTolerance = 1e-4;
constexpr Offset kEnvs = 32;

using Row = std::array<double, 9>;
Row row_of(const Issued& issued) {
  const auto one = [](std::uint64_t all) { return static_cast<double>(all) / static_cast<double>(kEnvs); };
  return {one(issued.instructions),      one(issued.lanes) / 32,         one(issued.of(Memory::scratch)),
          one(issued.of(Memory::lists)), one(issued.of(Memory::input)),  one(issued.of(Memory::output)),
          one(issued.of(Memory::stack)), one(issued.of(Memory::shared)), one(issued.barriers)};
}

/// Launches of traced kernels while it lives.
class Recorded {
 public:
  Recorded() { record_(&launches_); }
  ~Recorded() { record_(nullptr); }
  Recorded(const Recorded&) = delete;
  Recorded& operator=(const Recorded&) = delete;
  [[nodiscard]] const std::vector<TracedLaunch>& launches() const { return launches_; }

 private:
  using Record = void (*)(std::vector<TracedLaunch>*);
  std::vector<TracedLaunch> launches_;
  Record record_ = reinterpret_cast<Record>(
      dlsym(dlopen(std::getenv("STICTION_EMULATED_KERNELS"), RTLD_NOW), "stiction_ptx_record"));
};

std::string demangled(const std::string& name) {
  const std::unique_ptr<char, decltype(&std::free)> text(abi::__cxa_demangle(name.c_str(), nullptr, nullptr, nullptr),
                                                         std::free);
  return text == nullptr ? name : text.get();
}

/// Counts the instructions of kernels with `part` in their names. Every event of every lane has its part in it.
Issued replayed(const Recorded& recorded, const char* part) {
  Issued sum;
  std::uint64_t lanes = 0;
  for (const TracedLaunch& launch : recorded.launches()) {
    const std::string name = demangled(launch.kernel);
    if (name.find(part) == std::string::npos) continue;
    for (const Counted& counted : kCounted)
      if (name.find(counted.kernel) != std::string::npos) replay(launch, counted.places(launch), sum);
    for (const ptx::LaneTrace& lane : launch.lanes)
      for (const std::uint64_t event : lane.events)
        if (event >> 48U == ptx::kTracePiece) lanes += launch.code->pieces[event & 0xFFFFFFFFU].instructions;
  }
  EXPECT_EQ(sum.lanes, lanes);
  return sum;
}

/// A batch's arrays in one block of a device's memory, each where a line of its caches begins.
template <class View>
View in_device_memory(cuda::EmulatedDevice& device, const View& batch, cuda::DeviceMemory& memory) {
  cuda::ArraySet set;
  View there = batch;
  const auto make_room = [&](const BatchArray& array, const auto& from, auto& to) {
    if (from != nullptr) set.add(to, array.length);
  };
  for_each_held_array(batch, make_room, batch, there);
  memory = cuda::DeviceMemory(device, set.bytes());
  set.place(memory.get());
  const auto copy = [&](const BatchArray& array, const auto& from, const auto& to) {
    if (from != nullptr)
      std::memcpy(const_cast<void*>(static_cast<const void*>(to)), from,
                  static_cast<std::size_t>(array.length) * sizeof(*from));
  };
  for_each_held_array(batch, copy, batch, there);
  return there;
}

SolverOptions options_of(SolverKind solver) {
  SolverOptions options;
  options.solver = solver;
  options.tolerance = kTolerance;
  return options;
}

/// `auto` on J and M.
template <class Real>
Issued velocities(const io::Recording& recording, bool by_lanes, const std::vector<Offset>& order = {}) {
  const auto batch = io::jacobian_batch<Real>(recording, order);
  const SolverOptions options = options_of(SolverKind::automatic);
  const auto device = std::make_shared<cuda::EmulatedDevice>();
  cuda::DeviceMemory input, output;
  const JacobianBatchView<Real> there = in_device_memory(*device, batch.view(), input);
  JacobianSolutionView<Real> to;
  cuda::ArraySet set;
  set.add(to.lambda, there.row_count);
  set.add(to.w, there.row_count);
  set.add(to.velocity, there.dof_count);
  set.add(to.status, there.env_count);
  output = cuda::DeviceMemory(*device, set.bytes());
  set.place(output.get());
  Machine<Real> machine(device, JacobianCapacity::of(batch.view()), FactorUse::by_size, options,
                        cuda::VelocityRules{by_lanes ? 0 : kEnvs + 1});
  const cuda::Stream stream(*device);
  const Recorded recorded;
  machine.solve(there, to, StreamRef(stream.get()));
  device->synchronize(stream.get());
  Answer<Real> answer(batch.view());
  std::copy_n(to.lambda, there.row_count, answer.lambda.begin());
  std::copy_n(to.w, there.row_count, answer.w.begin());
  std::copy_n(to.velocity, there.dof_count, answer.velocity.begin());
  std::copy_n(to.status, there.env_count, answer.status.begin());
  expect_all(batch.view(), answer, batch.view(), solve(batch, options));
  return replayed(recorded, "Velocit");
}

/// Cotangents of velocities pulled back through `auto` on J and M, before J's and M's are written. Lanes answer all.
template <class Real>
Issued pulled_back(const io::Recording& recording) {
  const auto batch = io::jacobian_batch<Real>(recording);
  const JacobianBatchView<Real> here = batch.view();
  const auto lambda = solve(batch, options_of(SolverKind::automatic)).contact.lambda;
  JacobianChanges<Real> bars(here);
  bars.velocity = random_numbers<Real>(bars.velocity.size(), 1);
  JacobianGradients<Real> expected(here), found(here);
  const JacobianSolutionCotangentView<Real> cotangents{nullptr, nullptr, bars.velocity.data()};
  Derivative(Device::cpu()).vjp(here, {lambda.data(), nullptr}, cotangents, expected.view(), expected.status.data());
  JacobianBatchView<Real> there = here;
  there.space = MemorySpace::cuda;
  const Recorded recorded;
  const auto largest = JacobianCapacity::of(here);
  const Capacity capacity{.env_rows = largest.env_rows, .env_dofs = largest.env_dofs};
  Derivative(Device::emulated(), {}, capacity)
      .vjp(there, {lambda.data(), nullptr}, cotangents, found.view(), found.status.data());
  const auto one = expected.all(), two = found.all();
  EXPECT_TRUE(same_bits(std::span<const Real>(one), std::span<const Real>(two)));
  return replayed(recorded, "DerivativeLanes");
}

/// npgs on A. `by_lanes`: as if there were enough environments for a lane each.
template <class Real>
Issued npgs(const io::Recording& recording, bool by_lanes) {
  const auto batch = convert<Real>(recording.batch);
  const SolverOptions options = options_of(SolverKind::npgs);
  cuda::ClassRules rules;
  rules.many_per_processor = by_lanes ? 0 : batch.env_count() + 1;
  cuda::EmulatedDevice device;
  const Recorded recorded;
  EXPECT_EQ(env_hashes(batch, solve(batch, options)), on_engine(device, batch, options, rules));
  return replayed(recorded, "Npgs");
}

/// A step of robots, each of which has gone its own way for a while, or all of them one's. They have a lane each.
template <class Real>
Issued robots(const ArticulatedDescription& model, bool are_alike) {
  constexpr int kStepsBefore = 60;
  ArticulatedBatch<double> before(model, kEnvs);
  const auto fill = [&](std::span<double> numbers, std::uint64_t seed) {
    const std::size_t width = numbers.size() / static_cast<std::size_t>(kEnvs);
    for (std::size_t k = 0; k < numbers.size(); ++k) numbers[k] = number(seed + (are_alike ? k % width : k));
  };
  fill(before.qvel(), 0);
  fill(before.ctrl(), 5000);
  before.step(kStepsBefore);
  const ArticulatedOptions options{kTolerance, 100, 1};
  ArticulatedBatch<Real> here(model, kEnvs, options), there(Device::emulated(), model, kEnvs, options);
  for (auto* batch : {&here, &there}) {
    const auto copy = [](std::span<const double> from, std::span<Real> to) {
      for (std::size_t k = 0; k < from.size(); ++k) to[k] = static_cast<Real>(from[k]);
    };
    copy(before.qpos(), batch->qpos());
    copy(before.qvel(), batch->qvel());
    copy(before.qacc(), batch->qacc());
    copy(before.ctrl(), batch->ctrl());
  }
  const Recorded recorded;
  there.step();
  there.synchronize();
  here.step();
  EXPECT_EQ(here.hash(), there.hash());
  EXPECT_TRUE(same_bits(here.status(), there.status()));
  for (const EnvStatus& one : here.status()) EXPECT_EQ(one.code, EnvCode::solved);
  return replayed(recorded, "StepRobots");
}

constexpr const char* kRobots[] = {"g1", "humanoid", "go1", "leap_hand"};
io::Recording robot(const char* name) {
  return io::read_batch(std::string(STICTION_PTX_FOLDER) + "/robots/" + name + ".h5");
}

struct Walk {
  const char* name;
  ArticulatedDescription model;
};
const std::vector<Walk>& walks() {
  static const std::vector<Walk> all = {
      {"walker", walker(true)}, {"walker on rough ground", rough_walk(true)}, {"humanoid of 27", Humanoid::make()}};
  return all;
}

struct Count {
  const char* what;
  std::function<Issued(const io::Recording&)> of;
};
const std::vector<Count>& counts() {
  static const std::vector<Count> all = {
      {"velocities f32 in teams", [](const io::Recording& robot) { return velocities<float>(robot, false); }},
      {"velocities f64 in teams", [](const io::Recording& robot) { return velocities<double>(robot, false); }},
      {"velocities f32 in lanes", [](const io::Recording& robot) { return velocities<float>(robot, true); }},
      {"velocities f64 in lanes", [](const io::Recording& robot) { return velocities<double>(robot, true); }},
      {"reverse pass f32 in lanes", [](const io::Recording& robot) { return pulled_back<float>(robot); }},
      {"reverse pass f64 in lanes", [](const io::Recording& robot) { return pulled_back<double>(robot); }},
      {"npgs f32 in lanes", [](const io::Recording& robot) { return npgs<float>(robot, true); }},
      {"npgs f64 in lanes", [](const io::Recording& robot) { return npgs<double>(robot, true); }},
      {"npgs f32 in teams", [](const io::Recording& robot) { return npgs<float>(robot, false); }}};
  return all;
}

bool is_run_with_kernels() {
  return std::getenv("STICTION_EMULATED_KERNELS") != nullptr;
}

/// Functions that issue more than a twentieth.
void print_functions(const Issued& issued) {
  static const std::regex arguments("<[^<>]*>|\\([^()]*\\)( const)?|stiction::isa_cuda::");
  for (const auto& [function, instructions] : issued.by_function) {
    if (20 * instructions < issued.instructions) continue;
    std::string name = demangled(function), shorter;
    while ((shorter = std::regex_replace(name, arguments, "")) != name) name = shorter;
    std::printf("  %8.0f %s\n", static_cast<double>(instructions) / static_cast<double>(kEnvs), name.c_str());
  }
}

/// Adds what was counted to a table, or compares it. Returns false if the table is another compiler's.
bool holds(CountTable& table, const std::string& name, const Issued& issued) {
  const Row found = row_of(issued);
  std::string fields = STICTION_CUDA_COMPILER;
  for (const double value : found) fields += "," + std::to_string(std::llround(value));
  std::printf("%s: issued %.0f, efficiency %.2f\n", name.c_str(), found[0], issued.efficiency());
  print_functions(issued);
  const std::vector<std::string> allowed = table.add(name, fields);
  if (allowed.empty()) return true;
  EXPECT_EQ(allowed.size(), found.size() + 1) << name;
  if (allowed.size() != found.size() + 1) return true;
  if (allowed[0] != STICTION_CUDA_COMPILER) return false;
  for (std::size_t k = 0; k < found.size(); ++k)
    EXPECT_LE(found[k], (1 + kAllowed) * std::stod(allowed[k + 1]) + 1) << name << ", column " << k + 2;
  return true;
}

TEST(PtxLockstep, WarpsIssueNoMoreThanTheyDid) {
  if (!is_run_with_kernels()) GTEST_SKIP() << "no kernels are named to execute";
  CountTable table(STICTION_PTX_FOLDER "/lockstep.csv", kHead);
  for (const char* const robot_name : kRobots) {
    const io::Recording recording = robot(robot_name);
    ASSERT_EQ(recording.batch.env_count(), kEnvs);
    for (const Count& count : counts()) {
      const std::string name = std::string(robot_name) + ": " + count.what;
      if (!holds(table, name, count.of(recording))) GTEST_SKIP() << "counted with another nvcc";
    }
  }
  for (const Walk& walk : walks()) {
    const std::string name = walk.name;
    if (!holds(table, name + ": steps f32", robots<float>(walk.model, false)) ||
        !holds(table, name + ": steps f64", robots<double>(walk.model, false)))
      GTEST_SKIP() << "counted with another nvcc";
  }
}

/// Lanes that have the same environment never part.
TEST(PtxLockstep, AWarpOfOneEnvironmentIssuesWhatOneLaneExecutes) {
  if (!is_run_with_kernels()) GTEST_SKIP() << "no kernels are named to execute";
  for (const char* const name : kRobots) {
    const Issued issued = velocities<float>(robot(name), true, std::vector<Offset>(kEnvs, 5));
    EXPECT_GT(issued.instructions, 0U);
    EXPECT_EQ(32 * issued.instructions, issued.lanes) << name;
    std::printf("%s: issued %.0f\n", name, row_of(issued)[0]);
  }
  for (const Walk& walk : walks()) {
    const Issued issued = robots<float>(walk.model, true);
    EXPECT_EQ(32 * issued.instructions, issued.lanes) << walk.name;
    std::printf("%s: issued %.0f\n", walk.name, row_of(issued)[0]);
  }
}

}  // namespace
}  // namespace stiction::test
