#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <span>
#include <utility>

#include "cli/body_method.hpp"
#include "cli/load.hpp"
#include "cli/output.hpp"
#include "cli/stopwatch.hpp"
#include "distributed/program/column_slabs.hpp"
#include "distributed/program/commands.hpp"
#include "distributed/program/job_problem.hpp"
#include "distributed/program/partition_option.hpp"
#include "distributed/program/peak_memory.hpp"
#include "distributed/program/rank_report.hpp"
#include "distributed/solve/partition.hpp"
#include "distributed/transport/letters.hpp"
#include "stiction/error.hpp"
#include "stiction/hash.hpp"
#include "stiction/io.hpp"

namespace stiction::distributed {

namespace {

using cli::Clock;

template <class Real>
std::vector<double> widened(const std::vector<Real>& values) {
  return {values.begin(), values.end()};
}

template <class Real>
std::vector<RankReport> solve_newton(Transport& transport, const BodyBatchView<Real>& view, std::span<const int> part,
                                     std::optional<std::uint64_t> seed, const SolveArguments& arguments,
                                     const TimeStepping& stepping, const BodySolverOptions& options,
                                     const BodySolutionView<Real>& solution, const Real* first, NewtonCounts& counts) {
  DomainOptions domains;
  domains.sweeps = arguments.first_sweeps;
  domains.count = arguments.consensus.subdomains;
  const std::vector<int> home = seed ? random_owners(domains.count, transport.size(), *seed)
                                     : neighbouring_homes(domains.count, transport.size());
  return solve_by_newton<Real>(transport, view, part, home, domains, stepping, options, solution, first, &counts);
}

template <class Real>
int solve_in(Transport& transport, const SolveArguments& arguments, BodySolverOptions options, JobReport& report) {
  if (arguments.partition == kSlabs) return solve_column_slabs<Real>(transport, arguments, options, report);
  const Clock::time_point start = Clock::now();
  const JobProblem<Real> problem = job_problem<Real>(arguments);
  options.law = problem.law;
  const BodyBatchView<Real> view = problem.bodies.batch.view();
  const TimeStepping& stepping = problem.bodies.stepping;
  const std::optional<std::uint64_t> seed = partition_seed(arguments.partition);
  const bool by_consensus = arguments.method == "consensus", by_newton = arguments.method == "newton";
  const int parts = by_consensus || by_newton ? arguments.consensus.subdomains : transport.size();
  // Newton's method deals out whole subdomains, and they are always bisected.
  const std::vector<int> owner =
      seed && !by_newton ? random_owners(view.body_count, parts, *seed) : bisect(centres_by_arms(view), parts);
  cli::SolveReport& solve = report.solve;
  solve.seconds.load = cli::seconds_since(start);

  const bool is_first = transport.rank() == 0;
  std::vector<Real> impulse, w, twist;
  std::vector<EnvStatus> status;
  if (is_first) {
    impulse.resize(static_cast<std::size_t>(3 * view.contact_count));
    w.resize(impulse.size());
    twist.resize(static_cast<std::size_t>(6 * view.body_count));
    status.resize(static_cast<std::size_t>(view.env_count));
  }
  const auto data = [](auto& array) { return array.empty() ? nullptr : array.data(); };
  const Real* const first = data(problem.first);
  const BodySolutionView<Real> solution{data(impulse), data(twist), data(w), data(status)};
  report.ranks = by_newton ? solve_newton<Real>(transport, view, owner, seed, arguments, stepping, options, solution,
                                                first, report.newton)
                 : by_consensus ? solve_by_consensus<Real>(transport, view, owner, arguments.consensus, stepping,
                                                           options, solution, first)
                                : solve_over_ranks<Real>(transport, view, owner, stepping, options, solution, first);
  report.peak_memory = gather(transport, peak_memory());
  if (!is_first) return cli::kExitDone;
  for (const RankReport& rank : report.ranks) solve.seconds.solve = std::max(solve.seconds.solve, rank.seconds);
  const std::vector<Real> lambda = problem.rows(std::move(impulse));
  solve.law = options.law;
  solve.environments = view.env_count;
  solve.rows = problem.env_row_offsets.back();
  solve.cones = view.contact_count;
  report.bodies = view.body_count;
  solve.count(status);
  solve.hash = hash_bits(std::span<const Real>(lambda));
  if (arguments.output) {
    io::SolutionFile file;
    file.precision = solve.precision;
    file.lambda = widened(lambda);
    file.w = widened(problem.rows(std::move(w)));
    file.status = status;
    file.env_row_offsets = problem.env_row_offsets;
    file.law = solve.law;
    file.solver = solve.solver;
    file.source = fmt::format("stiction {} solve {}", kVersion, solve.file);
    io::write_solution(*arguments.output, file);
  }
  return solve.unconverged == 0 ? cli::kExitDone : cli::kExitMissed;
}

}  // namespace

int run_solve(Transport& transport, const SolveArguments& arguments) {
  const bool is_first = transport.rank() == 0;
  JobReport report;
  report.partition = arguments.partition;
  report.method = arguments.method;
  report.consensus = arguments.consensus;
  cli::SolveReport& solve = report.solve;
  solve.file = arguments.scene.empty() ? arguments.batch.string()
                                       : fmt::format("scene {}, seed {}", arguments.scene, arguments.seed);
  solve.solver = arguments.method == "consensus" ? "si" : arguments.method;
  solve.precision = cli::precision_from_option(arguments.precision);
  solve.options.tolerance = arguments.tolerance;
  solve.options.max_iterations = arguments.max_iterations;
  if (arguments.partition != kSlabs) partition_seed(arguments.partition);
  if (arguments.consensus.asynchronous && arguments.method != "consensus")
    throw Error(ErrorCode::invalid_argument,
                fmt::format("--asynchronous: method {} waits for every colour, and has the bits of one process; choose "
                            "--method consensus, or leave it out",
                            arguments.method));
  BodySolverOptions options;
  cli::choose_body_method(solve.solver, std::nullopt, options);
  options.tolerance = arguments.tolerance;
  options.iterations = arguments.max_iterations;
  options.omega = arguments.omega;
  cli::require_distinct({{"-o", arguments.output}, {"--json", arguments.json}});
  if (is_first && arguments.output) {
    if (!arguments.batch.empty()) cli::require_different(arguments.batch, *arguments.output);
    if (arguments.warm_start) cli::require_different(*arguments.warm_start, *arguments.output);
    cli::require_replaceable(*arguments.output);
  }
  if (is_first && arguments.json) cli::require_writable(*arguments.json);
  const int status = solve.precision == Precision::f32 ? solve_in<float>(transport, arguments, options, report)
                                                       : solve_in<double>(transport, arguments, options, report);
  if (is_first) {
    const bool json_on_stdout = arguments.json && *arguments.json == "-";
    if (!arguments.quiet && !json_on_stdout) fmt::print("{}", to_text(report));
    if (arguments.json) cli::write_text(*arguments.json, to_json(report));
    // Once a rank has ended with another status than 0, mpirun ends the others.
    if (std::fflush(stdout) != 0) throw Error(ErrorCode::io, "standard output cannot be written");
  }
  return status;
}

}  // namespace stiction::distributed
