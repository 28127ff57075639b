#include <fmt/format.h>

#include <cstdint>
#include <cstdio>
#include <iterator>
#include <string>

#include "cli/body_method.hpp"
#include "cli/output.hpp"
#include "cli/report.hpp"
#include "cli/step_world.hpp"
#include "distributed/program/commands.hpp"
#include "distributed/program/partition_option.hpp"
#include "distributed/program/rank_report.hpp"
#include "distributed/program/rank_stepped_world.hpp"
#include "stiction/error.hpp"

namespace stiction::distributed {

namespace {

/// Consensus and Newton's method over subdomains need lists of a whole scene, which no rank has while it steps.
void require_solver(const std::string& solver) {
  if (!cli::is_sweeping(solver))
    throw Error(ErrorCode::unsupported,
                fmt::format("--solver {}: ranks step a scene by si, npgs or pgs; choose one of them, or stiction step "
                            "in one process",
                            solver));
}

/// Every rank has its bodies.
template <class Real>
cli::StepReport step_in(Transport& transport, const StepJobArguments& arguments, const scenes::WorldScene& scene,
                        std::vector<StepRankReport>& ranks) {
  const WorldOptions options = cli::world_options(arguments.step, scene.stepping);
  RankSteppedWorld<Real> world(transport, arguments, scene, options);
  cli::StepArguments own = arguments.step;
  if (transport.rank() != 0) own.quiet = true;
  cli::StepReport report = cli::run_steps(own, options, scene.description, Device::cpu(), world);
  ranks = world.reports();
  return report;
}

}  // namespace

int run_step(Transport& transport, const StepJobArguments& arguments) {
  const cli::StepArguments& step = arguments.step;
  const bool is_first = transport.rank() == 0;
  if (step.scene.empty())
    throw Error(ErrorCode::invalid_argument, "a scene is missing: stiction step --list shows them");
  require_solver(step.solver);
  partition_seed(arguments.partition);
  cli::require_distinct({{"-o", step.output}, {"--json", step.json}, {"--checkpoint", step.checkpoint}});
  if (is_first && step.json) cli::require_writable(*step.json);
  if (is_first && step.checkpoint) cli::require_replaceable(*step.checkpoint);
  const Precision precision = cli::precision_from_option(step.precision);
  const auto require_memory = [&](std::int64_t bodies) {
    cli::require_world_memory(step, bodies, precision, transport.size());
  };
  if (step.size > 0) {
    scenes::make_world(step.scene, 1);  // refuses a scene that is not there, or has no size
    require_memory(step.size);
  }
  const scenes::WorldScene scene = scenes::make_world(step.scene, step.size);
  require_memory(std::ssize(scene.description.bodies));
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
