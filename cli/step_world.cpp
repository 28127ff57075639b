#include "cli/step_world.hpp"

#include <fmt/format.h>

#include <chrono>
#include <cstdio>
#include <ctime>
#include <iterator>
#include <memory>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "cli/body_method.hpp"
#include "cli/gpu_meter.hpp"
#include "cli/memory.hpp"
#include "cli/output.hpp"
#include "cli/progress.hpp"
#include "cli/step_checkpoint.hpp"
#include "cli/step_monitor.hpp"
#include "stiction/error.hpp"
#include "stiction/hash.hpp"

namespace stiction::cli {

namespace {

using Clock = std::chrono::steady_clock;

/// Tolerance for the residual where all iterations are run.
constexpr double kQualityTolerance = 1e-3;

/// Processor seconds of this process so far.
double cpu_seconds() {
  return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

/// States as lines of a CSV file; without a path nothing.
class StateFile {
 public:
  explicit StateFile(const std::optional<std::filesystem::path>& path) {
    if (!path) return;
    require_writable(*path);
    name_ = path->string();
    file_.reset(*path == "-" ? stdout : std::fopen(path->c_str(), "wb"));
    put(kStateHeader);
  }

  template <class Real>
  void write(const World<Real>& world, std::int64_t step) {
    if (!file_) return;
    const WorldState<Real> state = world.state();
    for (Offset env = 0; env < world.env_count(); ++env) {
      std::string text;
      for (Index body = 0; body < world.body_count(); ++body) {
        const auto place = static_cast<std::size_t>(env * world.body_count() + body);
        text += state_line<Real>(step, env, body,
                                 {state.position.subspan(3 * place, 3), state.orientation.subspan(4 * place, 4),
                                  state.twist.subspan(6 * place, 6)});
      }
      put(text);
    }
  }

  /// \throws Error(io) if something was not written.
  void close() {
    if (file_ && std::fflush(file_.get()) != 0) fail();
    file_.reset();
  }

 private:
  struct Close {
    void operator()(std::FILE* file) const {
      if (file != stdout) std::fclose(file);
    }
  };
  void put(const std::string& text) {
    if (!file_ || std::fwrite(text.data(), 1, text.size(), file_.get()) != text.size()) fail();
  }
  [[noreturn]] void fail() const { throw Error(ErrorCode::io, fmt::format("{}: cannot be written", name_)); }

  std::string name_;
  std::unique_ptr<std::FILE, Close> file_;
};

/// World::hash() of a world of the first `count` environments.
template <class Real>
std::uint64_t hash_of_first(const World<Real>& world, Offset count) {
  const WorldState<Real> state = world.state();
  const auto bodies = static_cast<std::size_t>(count * world.body_count());
  std::vector<Real> first;
  for (const auto& [values, each] :
       {std::pair{state.position, 3U}, std::pair{state.orientation, 4U}, std::pair{state.twist, 6U}}) {
    const auto part = values.first(each * bodies);
    first.insert(first.end(), part.begin(), part.end());
  }
  return hash_bits(std::span<const Real>(first));
}

/// A world of this process.
template <class Real>
class WorldHere final : public SteppedWorld {
 public:
  WorldHere(const StepArguments& arguments, const scenes::WorldScene& scene, Device device, const WorldOptions& options)
      : arguments_(arguments),
        world_(device, scene.description, arguments.environments, options),
        checkpoint_(arguments, options) {
    scenes::start_all(world_, arguments.scene, arguments.seed, arguments.size);
  }

  std::int64_t resume() override {
    const std::int64_t done = checkpoint_.resume(world_);
    states_ = std::make_unique<StateFile>(arguments_.output);
    return done;
  }
  void step() override { world_.step(); }
  std::vector<WorldMotion> motion() override { return world_.motion(); }
  std::vector<EnvSeen> see() override { return cli::see(world_); }
  void write_states(std::int64_t step) override { states_->write(world_, step); }
  void close_states() override { states_->close(); }
  void write_checkpoint(std::int64_t step) override { checkpoint_.after(step, world_); }
  WorldSeconds seconds() override { return world_.seconds(); }
  std::uint64_t hash() override {
    return arguments_.hashed ? hash_of_first(world_, *arguments_.hashed) : world_.hash();
  }

 private:
  const StepArguments& arguments_;
  World<Real> world_;
  StepCheckpoint checkpoint_;
  std::unique_ptr<StateFile> states_;
};

}  // namespace

WorldOptions world_options(const StepArguments& arguments, const TimeStepping& stepping) {
  WorldOptions options;
  options.stepping = stepping;
  options.stepping.dt = arguments.dt.value_or(stepping.dt);
  choose_body_method(arguments.solver, arguments.preconditioner, options.solver);
  choose_contact_law(arguments.law, options.solver);
  options.solver.blocks = block_mode_from_string(arguments.blocks);
  options.solver.iterations = arguments.iterations;
  options.solver.tolerance = arguments.tolerance;
  options.solver.threads = arguments.threads;
  options.solver.max_contacts_per_env = arguments.max_contacts;
  options.warm_start = arguments.warm_start;
  return options;
}

template <class Real>
std::string state_line(std::int64_t step, Offset env, Index body, const WorldState<Real>& of) {
  return fmt::format("{},{},{},{},{},{}\n", step, env, body, fmt::join(of.position, ","),
                     fmt::join(of.orientation, ","), fmt::join(of.twist, ","));
}

StepReport run_steps(const StepArguments& arguments, const WorldOptions& options, const WorldDescription& description,
                     Device device, SteppedWorld& world) {
  const std::int64_t done = world.resume();
  const double tolerance = arguments.tolerance > 0 ? arguments.tolerance : kQualityTolerance;
  StepMonitor monitor(description, options.stepping.dt, world.motion(), tolerance, arguments.steps - done);
  StepReport report;
  if (arguments.every > 0) world.write_states(done);
  {
    GpuMeter gpu(device);
    Progress progress("step", arguments.steps - done, arguments.quiet);
    for (std::int64_t step = done + 1; step <= arguments.steps; ++step) {
      const ThreadMeter meter;
      const double cpu_start = cpu_seconds();
      const Clock::time_point start = Clock::now();
      world.step();
      report.wall += std::chrono::duration<double>(Clock::now() - start).count();
      report.cpu += cpu_seconds() - cpu_start;
      report.thread_use += meter.use();
      monitor.look(world.see());
      if (arguments.every > 0 && step % arguments.every == 0) world.write_states(step);
      world.write_checkpoint(step);
      progress.advance();
    }
    report.gpu = gpu.end();
  }
  if (arguments.every == 0) world.write_states(arguments.steps);
  world.close_states();
  report.resumed_at = done;
  report.bodies = static_cast<std::int64_t>(description.bodies.size());
  report.dt = options.stepping.dt;
  report.solver = arguments.solver;
  report.law = arguments.law;
  report.blocks = arguments.blocks;
  if (arguments.solver == "newton") report.preconditioner = to_string(options.solver.space.preconditioner);
  report.iterations = options.solver.iterations;
  report.tolerance = tolerance;
  report.seconds = world.seconds();
  report.quality = monitor.quality();
  report.residual = quantiles(monitor.residuals());
  report.codes = monitor.codes();
  report.contacts = monitor.contacts();
  report.overflows = monitor.overflows();
  report.energy_begin = monitor.energy_begin();
  report.energy_end = monitor.energy_end();
  report.largest_rise = monitor.largest_rise();
  report.momentum_drift = monitor.momentum_drift();
  report.deepest = monitor.deepest();
  report.hash = world.hash();
  return report;
}

void require_world_memory(const StepArguments& arguments, std::int64_t bodies, Precision precision, int ranks) {
  // State and wrench of a world, and the state that start_all() makes it begin with. Arrays that a machine keeps
  // beside them, and contacts, come on top.
  constexpr double kNumbers = (3 + 4 + 6) + 6 + (3 + 4 + 6);
  const double of_number = precision == Precision::f32 ? sizeof(float) : sizeof(double);
  const auto all = static_cast<double>(arguments.environments);
  const auto each = static_cast<double>(bodies);
  require_memory(all * (each / ranks * kNumbers * of_number + sizeof(EnvStatus)) + each * sizeof(WorldBody),
                 fmt::format("{} with {} environments of {} bodies (--envs, --size)", arguments.scene,
                             arguments.environments, bodies));
}

template <class Real>
StepReport step_world(const StepArguments& arguments, const scenes::WorldScene& scene, Device device) {
  require_world_memory(arguments, std::ssize(scene.description.bodies),
                       std::is_same_v<Real, float> ? Precision::f32 : Precision::f64);
  const WorldOptions options = world_options(arguments, scene.stepping);
  WorldHere<Real> world(arguments, scene, device, options);
  return run_steps(arguments, options, scene.description, device, world);
}

template std::string state_line(std::int64_t, Offset, Index, const WorldState<float>&);
template std::string state_line(std::int64_t, Offset, Index, const WorldState<double>&);
template StepReport step_world<float>(const StepArguments&, const scenes::WorldScene&, Device);
template StepReport step_world<double>(const StepArguments&, const scenes::WorldScene&, Device);

}  // namespace stiction::cli
