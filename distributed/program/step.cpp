#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <span>

#include "distributed/program/commands.hpp"
#include "distributed/program/partition_option.hpp"
#include "distributed/program/rank_report.hpp"
#include "distributed/solve/partition.hpp"
#include "stiction/error.hpp"
#include "tools/cli/output.hpp"
#include "tools/cli/report.hpp"
#include "tools/cli/step_world.hpp"

namespace stiction::distributed {

namespace {

/// Rank 0's array on all ranks.
template <class T>
void broadcast(Transport& transport, T* values, Offset count) {
  if (count == 0) return;
  const std::span<T> array(values, static_cast<std::size_t>(count));
  if (transport.rank() != 0) {
    const Incoming in{0, std::as_writable_bytes(array)};
    return transport.exchange({}, {&in, 1});
  }
  std::vector<Outgoing> out;
  for (int rank = 1; rank < transport.size(); ++rank) out.push_back({rank, std::as_bytes(array)});
  if (!out.empty()) transport.exchange(out, {});
}

void add(RankReport& total, const RankReport& more) {
  total.seconds += more.seconds;
  total.waited += more.waited;
  total.bodies = more.bodies;
  total.ghosts = more.ghosts;
  total.contacts += more.contacts;
  total.exchanges += more.exchanges;
  total.gathers += more.gathers;
  total.messages += more.messages;
  total.bytes += more.bytes;
}

/// Contacts of a step by all ranks; every rank has every world, and gets the whole answer.
template <class Real>
cli::StepReport step_in(Transport& transport, const StepJobArguments& arguments, const scenes::WorldScene& scene,
                        std::vector<RankReport>& totals) {
  const WorldOptions options = cli::world_options(arguments.step, scene.stepping);
  BodySolverOptions isolating = options.solver;
  isolating.invalid = InvalidPolicy::isolate;
  const std::optional<std::uint64_t> seed = partition_seed(arguments.partition);
  totals.assign(static_cast<std::size_t>(transport.size()), {});
  const StepSolver<Real> solve = [&](const BodyBatchView<Real>& batch, const BodySolutionView<Real>& solution,
                                     const Real* guess) {
    const std::vector<int> owner = seed ? random_owners(batch.body_count, transport.size(), *seed)
                                        : bisect(centres_by_arms(batch), transport.size());
    const std::vector<RankReport> ranks =
        solve_over_ranks<Real>(transport, batch, owner, options.stepping, isolating,
                               transport.rank() == 0 ? solution : BodySolutionView<Real>{}, guess);
    broadcast(transport, solution.impulse, 3 * batch.contact_count);
    broadcast(transport, solution.twist, 6 * batch.body_count);
    broadcast(transport, solution.status, batch.env_count);
    for (std::size_t rank = 0; rank < totals.size(); ++rank) add(totals[rank], ranks[rank]);
  };
  cli::StepArguments own = arguments.step;
  if (transport.rank() != 0) {
    own.quiet = own.checkpoint_read_only = true;
    own.output.reset();
  }
  return cli::step_world<Real>(own, scene, Device::cpu(), solve);
}

}  // namespace

int run_step(Transport& transport, const StepJobArguments& arguments) {
  const cli::StepArguments& step = arguments.step;
  const bool is_first = transport.rank() == 0;
  if (step.scene.empty())
    throw Error(ErrorCode::invalid_argument, "a scene is missing: stiction step --list shows them");
  partition_seed(arguments.partition);
  if (is_first && step.json) cli::require_writable(*step.json);
  if (is_first && step.checkpoint) cli::require_replaceable(*step.checkpoint);
  const scenes::WorldScene scene = scenes::make_world(step.scene, step.size);
  const Precision precision = cli::precision_from_option(step.precision);
  StepJobReport report;
  report.partition = arguments.partition;
  report.step = precision == Precision::f32 ? step_in<float>(transport, arguments, scene, report.ranks)
                                            : step_in<double>(transport, arguments, scene, report.ranks);
  cli::StepReport& done = report.step;
  done.scene = step.scene;
  done.device = cli::to_string(Device::cpu());
  done.device_name = fmt::format("{} ranks", transport.size());
  done.precision = precision;
  done.environments = step.environments;
  done.steps = step.steps;
  done.seed = step.seed;
  done.threads = transport.size();
  done.thread_use = {};  // of this rank alone
  if (is_first) {
    if (step.json) cli::write_text(*step.json, to_json(report));
    const bool printed = step.json == "-" || step.output == "-";
    if (!step.quiet && !printed) fmt::print("{}", to_text(report));
    if (std::fflush(stdout) != 0) throw Error(ErrorCode::io, "standard output cannot be written");
  }
  return cli::exit_status(done);
}

}  // namespace stiction::distributed
