#include "cli/solve_options.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <optional>

#include "cli/body_method.hpp"
#include "cli/output.hpp"
#include "stiction/error.hpp"
#include "stiction/preset.hpp"

namespace stiction::cli {

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
  if (takes_jacobian(arguments) && !is_bodies(arguments)) options.solver = SolverKind::automatic;
  if (arguments.solver && !is_bodies(arguments)) options.solver = solver_from_string(*arguments.solver);
  options.tolerance = arguments.tolerance.value_or(options.tolerance);
  options.absolute_tolerance = arguments.absolute_tolerance;
  options.max_iterations = arguments.max_iterations.value_or(options.max_iterations);
  options.omega = arguments.omega;
  options.direct_rows = arguments.direct_rows;
  options.islands = island_mode_from_string(arguments.islands);
  options.choose = solver_choice_from_string(arguments.choose);
  options.blocks = block_mode_from_string(arguments.blocks);
  options.threads = arguments.threads;
  options.invalid = arguments.isolate ? InvalidPolicy::isolate : InvalidPolicy::reject;
  return options;
}

BodySolverOptions body_options(const SolveArguments& arguments, const SolverOptions& common, Law law) {
  BodySolverOptions options;
  choose_body_method(arguments.solver.value_or("newton"), arguments.preconditioner, options);
  options.law = law;
  options.tolerance = common.tolerance;
  options.absolute_tolerance = common.absolute_tolerance;
  options.iterations = common.max_iterations;
  options.omega = common.omega;
  options.blocks = block_mode_from_string(arguments.blocks);
  options.asynchronous = arguments.asynchronous;
  options.threads = common.threads;
  options.invalid = common.invalid;
  return options;
}

io::RecordWhen record_when(const std::string& text) {
  if (text == "failed") return io::RecordWhen::failed;
  if (text == "always") return io::RecordWhen::always;
  throw Error(ErrorCode::invalid_argument, fmt::format("--record-when {}: expected failed or always", text));
}

namespace {

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
  if (solver_choice_from_string(arguments.choose) == SolverChoice::spectrum &&
      (arguments.solver || is_bodies(arguments)))
    throw Error(ErrorCode::invalid_argument,
                fmt::format("--choose spectrum and {} exclude one another: leave one of them out",
                            arguments.solver ? "--solver" : "--form bodies"));
  if (arguments.preconditioner && !is_bodies(arguments))
    throw Error(ErrorCode::invalid_argument,
                fmt::format("--preconditioner {} applies to bodies only: choose --form bodies --solver newton",
                            *arguments.preconditioner));
  if (arguments.asynchronous && (!is_bodies(arguments) || arguments.shard))
    throw Error(ErrorCode::invalid_argument,
                arguments.shard ? "--asynchronous and --shard exclude one another, since merged parts have the bits of "
                                  "one solve: leave one of them out"
                                : "--asynchronous applies to sweeps of bodies only: choose --form bodies --solver si");
  if (!takes_jacobian(arguments)) return;
  if (is_bodies(arguments)) {
    body_options(arguments, SolverOptions{}, Law::convex);
    std::string excluded = arguments.preset ? "--preset" : "";
    if (arguments.islands != "together") excluded = "--islands apart";
    if (!excluded.empty())
      throw Error(ErrorCode::invalid_argument,
                  fmt::format("--form bodies and {} exclude one another: leave one of them out", excluded));
    if (arguments.blocks == "strong" ||
        (arguments.blocks != "cones" && !is_sweeping(arguments.solver.value_or("newton"))))
      throw Error(
          ErrorCode::invalid_argument,
          fmt::format("--form bodies --blocks {}: blocks of bodies are pairs, and of sweeps: choose --blocks pairs "
                      "--solver si",
                      arguments.blocks));
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

}  // namespace

void check_solve_arguments(const SolveArguments& arguments) {
  record_when(arguments.record_when);
  check_pyramid(arguments);
  check_form(arguments);
  check_outputs(arguments);
}

}  // namespace stiction::cli
