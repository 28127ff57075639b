#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <span>
#include <thread>

#include "cli/load.hpp"
#include "cli/output.hpp"
#include "cli/progress.hpp"
#include "cli/report.hpp"
#include "cli/scaling_report.hpp"
#include "cli/step_world.hpp"
#include "stiction/error.hpp"
#include "stiction/hash.hpp"
#include "stiction/solver.hpp"

namespace stiction::cli {

namespace {

/// A run of `copies` times the environments on so many threads. Its hash is over the environments of one copy.
using Run = std::function<ScalingPoint(int threads, int copies)>;

template <class Real>
Run run_of_file(const ScalingArguments& arguments, const ContactBatch<double>& file_batch, SolverOptions options) {
  return [&arguments, options, batch = convert<Real>(file_batch)](int threads, int copies) {
    std::vector<Offset> order;
    for (int copy = 0; copy < copies; ++copy)
      for (Offset env = 0; env < batch.env_count(); ++env) order.push_back(env);
    const ContactBatch<Real> many = gather(batch, std::span<const Offset>(order));
    SolverOptions own = options;
    own.threads = threads;
    const Solver solver(Device::cpu(), own);
    const Plan plan = solver.plan(many.view());
    Solution<Real> solution;
    solution.lambda.resize(static_cast<std::size_t>(many.row_count()));
    solution.status.resize(static_cast<std::size_t>(many.env_count()));
    Timing timing = shortest_of(arguments.repeat, [&] {
      solver.solve(plan, many.view(), {solution.lambda.data(), nullptr, solution.status.data()});
    });
    const auto first = std::span<const Real>(solution.lambda).first(static_cast<std::size_t>(batch.row_count()));
    return ScalingPoint{threads, many.env_count(), timing.seconds, std::move(timing.threads), hash_bits(first)};
  };
}

template <class Real>
Run run_of_scene(const ScalingArguments& arguments, const StepArguments& step) {
  return [&arguments, step, scene = scenes::make_world(arguments.target)](int threads, int copies) {
    StepArguments own = step;
    own.threads = threads;
    own.environments = copies * arguments.environments;
    own.hashed = arguments.environments;
    ScalingPoint shortest;
    for (int turn = 0; turn < arguments.repeat; ++turn) {
      const StepReport report = step_world<Real>(own, scene, Device::cpu());
      if (turn == 0 || report.wall < shortest.seconds)
        shortest = {threads, own.environments, report.wall, report.thread_use, report.hash};
    }
    return shortest;
  };
}

Run run_of_file(const ScalingArguments& arguments, ScalingReport& report) {
  SolverOptions options;
  if (arguments.solver) options.solver = solver_from_string(*arguments.solver);
  options.tolerance = arguments.tolerance.value_or(options.tolerance);
  options.max_iterations = arguments.max_iterations.value_or(options.max_iterations);
  report.solver = to_string(options.solver);
  const LoadedBatch loaded = load_batch(arguments.target, std::nullopt, ValueDefects::refuse, options.solver);
  const ContactBatch<double>& batch = loaded.recording.batch;
  if (batch.env_count() == 0)
    throw Error(ErrorCode::invalid_argument, fmt::format("{}: it has no environments to solve", arguments.target));
  return report.precision == Precision::f32 ? run_of_file<float>(arguments, batch, options)
                                            : run_of_file<double>(arguments, batch, options);
}

Run run_of_scene(const ScalingArguments& arguments, ScalingReport& report) {
  const std::vector<std::string> names = scenes::world_names();
  if (std::find(names.begin(), names.end(), arguments.target) == names.end())
    throw Error(ErrorCode::invalid_argument, fmt::format("{}: neither a file nor a scene of stiction step ({})",
                                                         arguments.target, fmt::join(names, ", ")));
  StepArguments step;
  step.scene = arguments.target;
  step.steps = arguments.steps;
  step.seed = arguments.seed;
  step.solver = arguments.solver.value_or(step.solver);
  step.tolerance = arguments.tolerance.value_or(step.tolerance);
  step.iterations = arguments.max_iterations.value_or(step.iterations);
  step.quiet = true;
  report.solver = step.solver;
  report.steps = step.steps;
  return report.precision == Precision::f32 ? run_of_scene<float>(arguments, step)
                                            : run_of_scene<double>(arguments, step);
}

/// Powers of two, and all cores.
std::vector<int> powers_of_two(int cores) {
  std::vector<int> threads;
  for (int count = 1; count < cores; count *= 2) threads.push_back(count);
  threads.push_back(cores);
  return threads;
}

std::vector<int> sorted_threads(std::vector<int> threads, int cores) {
  if (threads.empty()) threads = powers_of_two(cores);
  std::sort(threads.begin(), threads.end());
  threads.erase(std::unique(threads.begin(), threads.end()), threads.end());
  return threads;
}

}  // namespace

int run_scaling(const ScalingArguments& arguments) {
  ScalingReport report;
  report.target = arguments.target;
  report.precision = precision_from_option(arguments.precision);
  report.cores = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  report.repeat = arguments.repeat;
  report.is_scene = !std::filesystem::exists(arguments.target);
  if (arguments.json && !report.is_scene) require_different(arguments.target, *arguments.json);
  if (arguments.json) require_writable(*arguments.json);
  const Run run = report.is_scene ? run_of_scene(arguments, report) : run_of_file(arguments, report);
  const std::vector<int> threads = sorted_threads(arguments.threads, report.cores);
  {
    Progress progress("scaling", static_cast<std::int64_t>(threads.size()) * (arguments.weak ? 2 : 1), arguments.quiet);
    const auto series = [&](bool is_weak) {
      ScalingSeries all;
      for (const int count : threads) {
        all.points.push_back(run(count, is_weak ? count : 1));
        progress.advance();
      }
      return all;
    };
    report.strong = series(false);
    if (arguments.weak) report.weak = series(true);
  }
  if (!arguments.quiet && arguments.json != "-") fmt::print("{}", to_text(report));
  if (arguments.json) write_text(*arguments.json, to_json(report));
  return report.bits_agree() ? kExitDone : kExitMissed;
}

}  // namespace stiction::cli
