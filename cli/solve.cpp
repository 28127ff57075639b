#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <numeric>
#include <optional>
#include <thread>

#include "cli/body_method.hpp"
#include "cli/claims.hpp"
#include "cli/commands.hpp"
#include "cli/convergence.hpp"
#include "cli/gpu_meter.hpp"
#include "cli/load.hpp"
#include "cli/output.hpp"
#include "cli/permute.hpp"
#include "cli/progress.hpp"
#include "cli/report.hpp"
#include "cli/shard.hpp"
#include "cli/solve_bodies.hpp"
#include "cli/solve_jacobian.hpp"
#include "cli/stopwatch.hpp"
#include "stiction/error.hpp"
#include "stiction/hash.hpp"
#include "stiction/io.hpp"
#include "stiction/preset.hpp"
#include "stiction/pyramid.hpp"
#include "stiction/recorder.hpp"
#include "stiction/solver.hpp"
#include "stiction/trace.hpp"

namespace stiction::cli {

namespace {

/// Environments that --record keeps at most.
constexpr Offset kMostRecorded = 1024;

/// Whether J and M of the file are read: they are solved, or the bodies that they are of.
bool takes_jacobian(const SolveArguments& arguments) {
  for (const char* form : {"jacobian", "bodies"})
    if (arguments.form == form) return true;
  if (arguments.form == "matrix") return false;
  throw Error(ErrorCode::invalid_argument,
              fmt::format("--form {}: expected matrix, jacobian or bodies", arguments.form));
}
bool is_bodies(const SolveArguments& arguments) {
  return arguments.form == "bodies";
}

SolverOptions solver_options(const SolveArguments& arguments) {
  SolverOptions options = arguments.preset ? options_for(preset_from_string(*arguments.preset)) : SolverOptions{};
  if (takes_jacobian(arguments)) options.solver = SolverKind::automatic;
  if (arguments.solver && !is_bodies(arguments)) options.solver = solver_from_string(*arguments.solver);
  options.tolerance = arguments.tolerance.value_or(options.tolerance);
  options.absolute_tolerance = arguments.absolute_tolerance;
  options.max_iterations = arguments.max_iterations.value_or(options.max_iterations);
  options.omega = arguments.omega;
  options.direct_rows = arguments.direct_rows;
  options.islands = island_mode_from_string(arguments.islands);
  options.threads = arguments.threads;
  options.invalid = arguments.isolate ? InvalidPolicy::isolate : InvalidPolicy::reject;
  return options;
}

/// What a solver of bodies is told; the law is that of the batch.
BodySolverOptions body_options(const SolveArguments& arguments, const SolverOptions& common, Law law) {
  BodySolverOptions options;
  choose_body_method(arguments.solver.value_or("newton"), arguments.preconditioner, options);
  options.law = law;
  options.tolerance = common.tolerance;
  options.absolute_tolerance = common.absolute_tolerance;
  options.iterations = common.max_iterations;
  options.omega = common.omega;
  options.threads = common.threads;
  options.invalid = common.invalid;
  return options;
}

/// Whatever can be refused is refused before the file is read, let alone solved.
void check_outputs(const SolveArguments& arguments) {
  require_distinct({{"-o", arguments.output},
                    {"--json", arguments.json},
                    {"--trace", arguments.trace},
                    {"--convergence", arguments.convergence},
                    {"--record", arguments.record}});
  const auto check = [&](const std::optional<std::filesystem::path>& path,
                         void (*probe)(const std::filesystem::path&)) {
    if (!path) return;
    require_different(arguments.batch, *path);
    if (arguments.warm_start) require_different(*arguments.warm_start, *path);
    probe(*path);
  };
  for (const auto& file : {arguments.output, arguments.record}) check(file, require_replaceable);
  for (const auto& text : {arguments.json, arguments.trace, arguments.convergence}) check(text, require_writable);
}

/// Pyramids, recordings and curves are of A; islands and presets are not of bodies.
void check_form(const SolveArguments& arguments) {
  if (arguments.preconditioner && !is_bodies(arguments))
    throw Error(ErrorCode::invalid_argument,
                fmt::format("--preconditioner {}: it is that of bodies: choose --form bodies --solver newton",
                            *arguments.preconditioner));
  if (!takes_jacobian(arguments)) return;
  if (is_bodies(arguments)) {
    body_options(arguments, SolverOptions{}, Law::convex);
    if (arguments.preset || arguments.islands != "together")
      throw Error(ErrorCode::invalid_argument,
                  fmt::format("--form bodies and {} exclude one another: leave one of them out",
                              arguments.preset ? "--preset" : "--islands apart"));
  }
  const char* other = arguments.pyramid > 0 ? "--pyramid" : arguments.record ? "--record" : nullptr;
  if (arguments.convergence) other = "--convergence";
  if (other != nullptr)
    throw Error(ErrorCode::invalid_argument,
                fmt::format("--form {} and {} exclude one another: leave one of them out", arguments.form, other));
}

/// Reactions of a cone are many sums of its pyramid's edges, so a warm start of cones has no single one of edges. And
/// what is solved is not what a recording is for.
void check_pyramid(const SolveArguments& arguments) {
  if (arguments.pyramid == 0 || (!arguments.warm_start && !arguments.record)) return;
  throw Error(ErrorCode::invalid_argument, fmt::format("--pyramid and {} exclude one another: leave one of them out",
                                                       arguments.warm_start ? "--warm-start" : "--record"));
}

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

template <class To, class From>
std::vector<To> convert_values(const std::vector<From>& values) {
  std::vector<To> converted;
  converted.reserve(values.size());
  for (const From value : values) converted.push_back(static_cast<To>(value));
  return converted;
}

/// A batch and a warm start in the precision and the order they are solved in.
template <class Real>
struct Work {
  ContactBatch<Real> batch;
  std::vector<Real> warm_start;  ///< empty: none
};

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
  file.solver = to_string(report.options.solver);
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

template <class Real>
Work<Real> prepare(const ContactBatch<double>& batch, const std::vector<double>& warm_start,
                   std::span<const Offset> order) {
  Work<Real> work{convert<Real>(batch), convert_values<Real>(warm_start)};
  if (!order.empty()) {
    work.batch = gather(work.batch, order);
    if (!warm_start.empty()) {
      work.warm_start = gather_rows(std::span<const Real>(work.warm_start),
                                    std::span<const Offset>(batch.arrays().env_row_offsets), order);
    }
  }
  return work;
}

io::RecordWhen record_when(const std::string& text) {
  if (text == "failed") return io::RecordWhen::failed;
  if (text == "always") return io::RecordWhen::always;
  throw Error(ErrorCode::invalid_argument, fmt::format("--record-when {}: expected failed or always", text));
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

/// J and M in the order of solving. `own` are the environments of a shard, which may have none.
template <class Real>
JacobianBatch<Real> jacobians_of(const std::string& file, const io::Recording& recording, std::vector<Offset> order,
                                 const std::optional<std::vector<Offset>>& own) {
  if (own && own->empty()) return JacobianBatch<Real>();
  if (own && order.empty())
    order = *own;
  else if (own)
    for (Offset& env : order) env = (*own)[static_cast<std::size_t>(env)];
  try {
    return io::jacobian_batch<Real>(recording, order);
  } catch (const Error& error) {
    throw Error(ErrorCode::bad_file, fmt::format("{}: {}", file, error.what()));
  }
}

template <class Real>
int solve_in(const SolveArguments& arguments, const Solver& solver, SolveReport& report, Clock::time_point start) {
  std::optional<Progress> stage(std::in_place, "loading", 0, arguments.quiet);
  std::optional<ScopedSpan> loading(std::in_place, report.options.tracer, "load");
  const auto policy = arguments.isolate ? ValueDefects::keep : ValueDefects::refuse;
  const LoadedBatch loaded = load_batch(arguments.batch, law_from_option(arguments.law), policy, report.options.solver);
  const ContactBatch<double>& whole = loaded.recording.batch;
  std::vector<double> warm_start;
  if (arguments.warm_start) warm_start = load_solution(*arguments.warm_start, whole).lambda;
  report.law = whole.law();
  std::optional<std::vector<Offset>> own;  // the shard's environments
  std::optional<ContactBatch<double>> part;
  if (report.shard) {
    own = describe_shard(arguments, warm_start, whole.env_count(), report, *report.shard);
    if (!warm_start.empty())
      warm_start = gather_rows(std::span<const double>(warm_start),
                               std::span<const Offset>(whole.arrays().env_row_offsets), *own);
    part = gather(whole, std::span<const Offset>(*own));
  }
  const ContactBatch<double>& file_batch = part ? *part : whole;
  std::optional<PyramidBatch<double>> pyramids;
  if (arguments.pyramid > 0) pyramids = linearise(file_batch, arguments.pyramid);
  const ContactBatch<double>& batch = pyramids ? pyramids->batch : file_batch;
  std::vector<Offset> order;
  if (arguments.permute) order = random_order(batch.env_count(), *arguments.permute);
  const Work<Real> work = prepare<Real>(batch, warm_start, order);
  const JacobianBatch<Real> jacobians =
      takes_jacobian(arguments) ? jacobians_of<Real>(report.file, loaded.recording, order, own) : JacobianBatch<Real>();
  report.environments = batch.env_count();
  report.rows = file_batch.row_count();
  report.cones = file_batch.view().cone_count;
  report.law = batch.law();
  report.seconds.load = seconds_since(start);
  loading.reset();

  GpuMeter gpu(solver.device());
  Solution<Real> solution;
  if (is_bodies(arguments)) {
    stage->relabel("solving");
    solution = solve_as_bodies(jacobians, solver.device(), body_options(arguments, solver.options(), report.law),
                               work.warm_start, arguments.repeat, report.seconds, report.options.tracer);
  } else if (takes_jacobian(arguments)) {
    stage->relabel("solving");
    solution = solve_jacobians(jacobians, solver.device(), solver.options(), work.warm_start, arguments.repeat,
                               report.seconds);
  } else {
    stage->relabel("planning");
    start = Clock::now();
    const Plan plan = solver.plan(work.batch.view());
    report.seconds.plan = seconds_since(start);
    stage->relabel("solving");
    report.seconds.take(
        shortest_of(arguments.repeat, [&] { solution = solve_work(solver, plan, work); }, report.options.tracer));
  }
  report.gpu = gpu.end();

  if (!order.empty()) solution = to_file_order(solution, batch.arrays().env_row_offsets, order);
  if (pyramids) solution = to_cones(*pyramids, file_batch, solution);
  if (!pyramids) judge_by_file(file_batch, report.options, solution);
  report.count(solution.status);
  report.hash = hash_bits(std::span<const Real>(solution.lambda));

  stage->relabel("writing");
  if (arguments.output) {
    const ScopedSpan writing(report.options.tracer, "write");
    io::write_solution(*arguments.output, solution_file(report, convert_values<double>(solution.lambda),
                                                        convert_values<double>(solution.w), solution.status,
                                                        file_batch.arrays().env_row_offsets));
  }
  if (arguments.record) {
    if (order.empty())
      record(*arguments.record, arguments, solver, work, solution);
    else
      record(*arguments.record, arguments, solver, prepare<Real>(batch, warm_start, {}), solution);
  }
  stage.reset();
  if (arguments.convergence) {
    const Work<Real> in_file_order = prepare<Real>(batch, warm_start, {});
    write_text(*arguments.convergence,
               run_convergence(arguments, report.options, solver.device(), in_file_order, batch.view()));
  }
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
  if (report.form == "bodies" && report.solver == "newton")
    report.preconditioner = to_string(body_options(arguments, report.options, Law::convex).space.preconditioner);
  report.precision = precision_from_option(arguments.precision);
  report.shard = shard_from_option(arguments.shard);
  record_when(arguments.record_when);
  check_pyramid(arguments);
  check_form(arguments);
  check_outputs(arguments);
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
