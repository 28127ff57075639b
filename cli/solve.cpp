#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <numeric>
#include <optional>
#include <thread>

#include "cli/claims.hpp"
#include "cli/convergence.hpp"
#include "cli/gpu_meter.hpp"
#include "cli/output.hpp"
#include "cli/progress.hpp"
#include "cli/solve_bodies.hpp"
#include "cli/solve_input.hpp"
#include "cli/solve_jacobian.hpp"
#include "cli/stopwatch.hpp"
#include "stiction/hash.hpp"
#include "stiction/recorder.hpp"
#include "stiction/trace.hpp"

namespace stiction::cli {

namespace {

/// Environments that --record keeps at most.
constexpr Offset kMostRecorded = 1024;

std::string name_of(Device device) {
  for (const DeviceReport& report : devices()) {
    if (report.device.kind == device.kind && report.device.ordinal == device.ordinal) return report.name;
  }
  return "?";
}

int thread_count(const SolverOptions& options, Device device) {
  if (device.kind != DeviceKind::cpu) return 0;
  if (options.threads > 0) return options.threads;
  const unsigned cores = std::thread::hardware_concurrency();
  return cores == 0 ? 1 : static_cast<int>(cores);
}

template <class Real>
Solution<Real> solve_work(const Solver& solver, const Plan& plan, const Work<Real>& work) {
  Solution<Real> solution;
  solution.lambda.resize(static_cast<std::size_t>(work.batch.row_count()));
  solution.w.resize(solution.lambda.size());
  solution.status.resize(static_cast<std::size_t>(work.batch.env_count()));
  solver.solve(plan, work.batch.view(), {solution.lambda.data(), solution.w.data(), solution.status.data()},
               work.warm_start.empty() ? nullptr : work.warm_start.data());
  return solution;
}

/// Back from the order of solving to the file's.
template <class Real>
Solution<Real> to_file_order(const Solution<Real>& solution, std::span<const Offset> env_row_offsets,
                             std::span<const Offset> order) {
  Solution<Real> sorted;
  sorted.lambda = scatter_rows(std::span<const Real>(solution.lambda), env_row_offsets, order);
  sorted.w = scatter_rows(std::span<const Real>(solution.w), env_row_offsets, order);
  sorted.status.resize(solution.status.size());
  for (std::size_t i = 0; i < order.size(); ++i) sorted.status[static_cast<std::size_t>(order[i])] = solution.status[i];
  return sorted;
}

/// Reactions and motions of pyramids in the rows of the file's cones; the status records stay the pyramids'.
template <class Real>
Solution<Real> to_cones(const PyramidBatch<double>& pyramids, const ContactBatch<double>& file_batch,
                        const Solution<Real>& solution) {
  const auto f = convert_values<double>(solution.lambda);
  const auto back = reactions(pyramids, file_batch, std::span<const double>(f));
  return {convert_values<Real>(back.lambda), convert_values<Real>(back.w), solution.status};
}

io::SolutionFile solution_file(const SolveReport& report, std::vector<double> lambda, std::vector<double> w,
                               std::vector<EnvStatus> status, const std::vector<Offset>& env_row_offsets) {
  io::SolutionFile file;
  file.precision = report.precision;
  file.lambda = std::move(lambda);
  file.w = std::move(w);
  file.status = std::move(status);
  file.env_row_offsets = env_row_offsets;
  file.law = report.law;
  file.solver = report.solver;
  file.source = fmt::format("stiction {} solve {}", kVersion, report.file);
  file.shard = report.shard;
  return file;
}

template <class Real>
std::string run_convergence(const SolveArguments& arguments, const SolverOptions& options, Device device,
                            const Work<Real>& work, const ContactBatchView<double>& file_batch) {
  const auto points = convergence_iterations(options.max_iterations);
  Progress progress("convergence", std::accumulate(points.begin(), points.end(), std::int64_t{0}), arguments.quiet);
  return convergence_csv(file_batch, options.max_iterations, [&](Index iterations) {
    SolverOptions prefix = options;
    prefix.tolerance = 0;
    prefix.max_iterations = iterations;
    prefix.stall_window = 0;
    prefix.tracer = nullptr;
    const Solver solver(device, prefix);
    auto lambda = solve_work(solver, solver.plan(work.batch.view()), work).lambda;
    progress.advance(iterations);
    return convert_values<double>(lambda);
  });
}

/// Environments in the file's order, whichever they were solved in. Without any no file is written.
template <class Real>
void record(const std::filesystem::path& file, const SolveArguments& arguments, const Solver& solver,
            const Work<Real>& work, Solution<Real>& solution) {
  io::Recorder recorder(file, {record_when(arguments.record_when), kMostRecorded, {}});
  recorder.take(solver, work.batch.view(), {solution.lambda.data(), solution.w.data(), solution.status.data()},
                work.warm_start.empty() ? nullptr : work.warm_start.data());
  if (arguments.quiet || (arguments.json && *arguments.json == "-")) return;
  if (recorder.recorded() > 0)
    fmt::print("{}: {} environments recorded, {} left out\n", file.string(), recorder.recorded(), recorder.left_out());
  else
    fmt::print("{}: nothing to record, {}\n", file.string(),
               std::filesystem::exists(file) ? "left as an earlier run wrote it" : "not written");
}

/// Solves in the order of solving, by the form that was asked for.
template <class Real>
Solution<Real> solve_input(const SolveArguments& arguments, const Solver& solver, const SolveInput<Real>& input,
                           Progress& stage, SolveReport& report) {
  if (is_bodies(arguments)) {
    stage.relabel("solving");
    return solve_as_bodies(input.jacobians, solver.device(), body_options(arguments, solver.options(), report.law),
                           input.work.warm_start, arguments.repeat, report.seconds, report.options.tracer);
  }
  if (takes_jacobian(arguments)) {
    stage.relabel("solving");
    return solve_jacobians(input.jacobians, solver.device(), solver.options(), input.work.warm_start, arguments.repeat,
                           report.seconds);
  }
  stage.relabel("planning");
  const Clock::time_point start = Clock::now();
  const Plan plan = solver.plan(input.work.batch.view());
  report.seconds.plan = seconds_since(start);
  stage.relabel("solving");
  Solution<Real> solution;
  report.seconds.take(
      shortest_of(arguments.repeat, [&] { solution = solve_work(solver, plan, input.work); }, report.options.tracer));
  return solution;
}

/// The solution in the order and the cones of the file, judged there.
template <class Real>
Solution<Real> as_in_file(const SolveInput<Real>& input, const SolverOptions& options, Solution<Real> solution) {
  if (!input.order.empty()) solution = to_file_order(solution, input.batch().arrays().env_row_offsets, input.order);
  if (input.pyramids) return to_cones(*input.pyramids, input.file_batch(), solution);
  judge_by_file(input.file_batch(), options, solution);
  return solution;
}

/// Outputs beside the report: the solution, failures, a curve of convergence.
template <class Real>
void write_outputs(const SolveArguments& arguments, const Solver& solver, const SolveInput<Real>& input,
                   std::optional<Progress>& stage, const SolveReport& report, Solution<Real>& solution) {
  stage->relabel("writing");
  if (arguments.output) {
    const ScopedSpan writing(report.options.tracer, "write");
    io::write_solution(*arguments.output, solution_file(report, convert_values<double>(solution.lambda),
                                                        convert_values<double>(solution.w), solution.status,
                                                        input.file_batch().arrays().env_row_offsets));
  }
  std::optional<Work<Real>> sorted;
  if (!input.order.empty() && (arguments.record || arguments.convergence))
    sorted = prepare<Real>(input.batch(), input.warm_start, {});
  const Work<Real>& in_file_order = sorted ? *sorted : input.work;
  if (arguments.record) record(*arguments.record, arguments, solver, in_file_order, solution);
  stage.reset();
  if (arguments.convergence)
    write_text(*arguments.convergence,
               run_convergence(arguments, report.options, solver.device(), in_file_order, input.batch().view()));
}

template <class Real>
int solve_in(const SolveArguments& arguments, const Solver& solver, SolveReport& report, Clock::time_point start) {
  std::optional<Progress> stage(std::in_place, "loading", 0, arguments.quiet);
  std::optional<ScopedSpan> loading(std::in_place, report.options.tracer, "load");
  const auto input = load_input<Real>(arguments, report);
  report.seconds.load = seconds_since(start);
  loading.reset();

  GpuMeter gpu(solver.device());
  Solution<Real> solution = solve_input(arguments, solver, input, *stage, report);
  report.gpu = gpu.end();
  solution = as_in_file(input, report.options, std::move(solution));
  report.count(solution.status);
  report.hash = hash_bits(std::span<const Real>(solution.lambda));
  write_outputs(arguments, solver, input, stage, report, solution);
  return report.unconverged == 0 ? kExitDone : kExitMissed;
}

}  // namespace

int run_solve(const SolveArguments& arguments) {
  const Clock::time_point start = Clock::now();
  SolveReport report;
  report.file = arguments.batch.string();
  report.options = solver_options(arguments);
  report.pyramid = arguments.pyramid;
  report.form = arguments.form;
  report.solver = is_bodies(arguments) ? arguments.solver.value_or("newton") : to_string(report.options.solver);
  if (report.options.choose == SolverChoice::spectrum) report.solver = to_string(report.options.choose);
  if (report.form == "bodies" && report.solver == "newton")
    report.preconditioner = to_string(body_options(arguments, report.options, Law::convex).space.preconditioner);
  report.asynchronous = arguments.asynchronous;
  report.precision = precision_from_option(arguments.precision);
  report.shard = shard_from_option(arguments.shard);
  check_solve_arguments(arguments);
  const Device device = Device::from_string(arguments.device);
  std::optional<Tracer> tracer;
  if (arguments.trace) report.options.tracer = &tracer.emplace();
  const Solver solver(device, report.options);
  report.device = to_string(device);
  report.threads = thread_count(report.options, device);

  const int status = report.precision == Precision::f32 ? solve_in<float>(arguments, solver, report, start)
                                                        : solve_in<double>(arguments, solver, report, start);

  const bool json_on_stdout = arguments.json && *arguments.json == "-";
  if (!arguments.quiet && !json_on_stdout) {
    report.device_name = name_of(device);
    fmt::print("{}", to_text(report));
  }
  if (arguments.json) write_text(*arguments.json, to_json(report));
  if (tracer && arguments.trace) {
    if (tracer->left_out() > 0) fmt::print(stderr, "the trace has no room for {} more spans\n", tracer->left_out());
    write_text(*arguments.trace, tracer->chrome_json());
  }
  return status;
}

}  // namespace stiction::cli
