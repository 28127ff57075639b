// The only translation unit here that includes CLI11, which takes longer to compile than all the others.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <functional>
#include <memory>
#include <new>
#include <stdexcept>
#include <utility>

#include "cli/commands.hpp"
#include "cli/python_command.hpp"
#include "cli/step_options.hpp"
#include "cli/whole_number.hpp"
#include "stiction/config.hpp"

namespace stiction::cli {

namespace {

using Command = std::function<int()>;

/// Declares a command whose arguments live as long as the parser; `declare` adds its options.
template <class Arguments, class Declare>
void add_command(CLI::App& app, Command& chosen, const char* name, const char* summary, int (*run)(const Arguments&),
                 Declare declare) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(name, summary);
  declare(*command, *arguments);
  command->callback([&chosen, run, arguments] { chosen = [run, arguments] { return run(*arguments); }; });
}

void declare_info(CLI::App& app, InfoArguments& a) {
  app.add_flag("--json", a.json, "Print JSON");
}

void declare_generate(CLI::App& app, GenerateArguments& a) {
  app.add_option("scene", a.scene, "Scene; --list shows them");
  app.add_option("--envs", a.environments, "Number of environments")->check(whole_number());
  app.add_option("--seed", a.seed, "Seed; an environment depends on scene, seed, size and its index alone")
      ->check(whole_number());
  app.add_option("--size", a.size, "Size of the scene (0: its default)")->check(whole_number());
  app.add_option("--threads", a.threads, "Threads (0: all cores)")->check(whole_number());
  app.add_flag("--box-friction", a.box_friction, "Boxed friction in place of friction cones");
  app.add_option("-o,--output", a.output, "Contact-batch file to write");
  app.add_flag("--list", a.list, "List the scenes");
  app.add_flag("--quiet", a.quiet, "No progress, no summary");
}

void declare_inspect(CLI::App& app, InspectArguments& a) {
  app.add_option("batch", a.batch, "Contact-batch or FCLIB file")->required();
  app.add_flag("--json", a.json, "Print JSON");
  app.add_option("--graph", a.graph, "Draw the contact graph of one environment (.svg or .dot)");
  app.add_option("--env", a.environment, "Look at this environment only");
}

void declare_solve(CLI::App& app, SolveArguments& a) {
  app.add_option("batch", a.batch, "Contact-batch or FCLIB file")->required();
  app.add_option("--solver", a.solver, "Solver, or auto [npgs]");
  app.add_option("--preconditioner", a.preconditioner, "Of --form bodies --solver newton");
  app.add_option("--preset", a.preset,
                 "navigation, locomotion, grasping or assembly: solver, tolerance and iterations");
  app.add_option("--device", a.device, "auto, cpu, cuda or cuda:I")->capture_default_str();
  app.add_option("--precision", a.precision, "f32 or f64")->capture_default_str();
  app.add_option("--law", a.law, "file, convex or coulomb")->capture_default_str();
  app.add_option("--form", a.form, "matrix: A; jacobian: J and M of the file; bodies: rigid bodies of J and M")
      ->capture_default_str();
  app.add_option("--islands", a.islands, "together, or apart: every island iterates and stops by itself")
      ->capture_default_str();
  app.add_option("--choose", a.choose, "named: --solver; spectrum: by condition and density of each environment's A")
      ->capture_default_str();
  app.add_option("--blocks", a.blocks,
                 "Of pgs, npgs, nsgs, si: contacts a sweep solves together: cones, pairs or strong")
      ->capture_default_str();
  app.add_option("--tolerance", a.tolerance, "On the relative residual; 0: run all iterations [1e-4]");
  app.add_option("--absolute-tolerance", a.absolute_tolerance, "On the largest error of a contact, in units of b")
      ->capture_default_str();
  app.add_option("--max-iterations", a.max_iterations, "Per environment [1000]");
  app.add_option("--omega", a.omega, "Relaxation of pgs, between 0 and 2")->capture_default_str();
  app.add_option("--direct-rows", a.direct_rows, "Rows up to which a matrix is factorised, CPU only")
      ->capture_default_str();
  app.add_option("--threads", a.threads, "CPU threads (0: all cores)")->capture_default_str();
  app.add_option("--repeat", a.repeat, "Solve so many times and report the shortest time")
      ->check(whole_number(1))
      ->capture_default_str();
  app.add_option("--pyramid", a.pyramid, "Replace friction cones by pyramids of 4, 8 or 16 sides, law convex")
      ->check(CLI::IsMember({4, 8, 16}));
  app.add_option("--permute", a.permute, "Solve the environments in a pseudo-random order of this seed")
      ->check(whole_number());
  app.add_option("--shard", a.shard,
                 "I/N: solve part I of N of the environments, I from 0; stiction merge joins parts");
  app.add_option("--warm-start", a.warm_start, "Solution file to start from");
  app.add_flag("--asynchronous", a.asynchronous,
               "Of --form bodies by sweeps, law convex: threads wait for no colour, and bits are others each time");
  app.add_flag("--isolate", a.isolate, "Flag environments with broken numbers and solve the others");
  app.add_option("-o,--output", a.output, "Solution file to write");
  app.add_option("--json", a.json, "JSON report to write; - is standard output");
  app.add_option("--trace", a.trace, "Chrome trace of where the time went to write");
  app.add_option("--record", a.record, "File to record environments to, for stiction replay");
  app.add_option("--record-when", a.record_when, "failed or always")->capture_default_str();
  app.add_option("--convergence", a.convergence, "CSV of residual against iterations to write");
  app.add_flag("--quiet", a.quiet, "No progress, no summary");
}

void declare_replay(CLI::App& app, ReplayArguments& a) {
  app.add_option("recording", a.recording, "File written by --record or a Recorder")->required();
  app.add_option("--device", a.device, "auto, cpu, cuda or cuda:I")->capture_default_str();
  app.add_option("--threads", a.threads, "CPU threads (0: all cores)")->capture_default_str();
  app.add_flag("--quiet", a.quiet, "Print nothing; the exit status says it");
}

void declare_verify(CLI::App& app, VerifyArguments& a) {
  app.add_option("batch", a.batch, "Contact-batch or FCLIB file")->required();
  app.add_option("solution", a.solution, "Solution file")->required();
  app.add_option("--tolerance", a.tolerance, "On the relative residual")->capture_default_str();
  app.add_option("--absolute-tolerance", a.absolute_tolerance, "On the absolute residual [w]: either will do")
      ->capture_default_str();
  app.add_option("--law", a.law, "file, convex or coulomb")->capture_default_str();
  app.add_flag("--json", a.json, "Print JSON");
}

void declare_hash(CLI::App& app, HashArguments& a) {
  app.add_option("solution", a.solution, "Solution file")->required();
  app.add_flag("--per-environment", a.per_environment, "A line per environment before the total");
}

void declare_diff(CLI::App& app, DiffArguments& a) {
  app.add_option("left", a.left, "Solution file")->required();
  app.add_option("right", a.right, "Solution file")->required();
}

void declare_merge(CLI::App& app, MergeArguments& a) {
  app.add_option("output", a.output, "Solution file to write")->required();
  app.add_option("parts", a.parts, "All parts that --shard wrote of one batch, in any order")->required();
  app.add_flag("--quiet", a.quiet, "No summary");
}

void declare_convert(CLI::App& app, ConvertArguments& a) {
  app.add_option("input", a.input, "Contact-batch or FCLIB file")->required();
  app.add_option("output", a.output, "File to write; .hdf5 is FCLIB, anything else a contact batch")->required();
  app.add_option("--to", a.to, "fclib or batch, whatever the output's extension");
  app.add_option("--env", a.environment, "The environment an FCLIB file is to hold");
}

void declare_step(CLI::App& app, StepArguments& a) {
  declare_steps(app, a);
  app.add_option("--device", a.device, "auto, cpu, cuda, cuda:I or emulated: where reactions are solved")
      ->capture_default_str();
  app.add_option("--solver", a.solver, "si or npgs, pgs, newton or multigrid")->capture_default_str();
  app.add_option("--preconditioner", a.preconditioner, "Of newton's linear systems [block_diagonal]");
  app.add_option("--max-contacts", a.max_contacts, "The deepest of an environment that are solved; 0: all")
      ->capture_default_str();
  app.add_option("--threads", a.threads, "CPU threads (0: all cores)")->check(whole_number())->capture_default_str();
  app.add_flag("--list", a.list, "List the scenes");
}

void declare_scaling(CLI::App& app, ScalingArguments& a) {
  app.add_option("target", a.target, "Contact-batch or FCLIB file to solve, or scene of stiction step to step")
      ->required();
  app.add_option("--threads", a.threads, "Numbers of CPU threads, as 1,2,4 [powers of 2 and all cores]")
      ->delimiter(',')
      ->check(whole_number(1));
  app.add_flag("--weak", a.weak, "Weak scaling, too: so many times the environments on so many threads");
  app.add_option("--repeat", a.repeat, "Runs for each number of threads, of which the shortest counts")
      ->check(whole_number(1))
      ->capture_default_str();
  app.add_option("--solver", a.solver, "Of a file: as in stiction solve [npgs]; of a scene: as in stiction step [si]");
  app.add_option("--precision", a.precision, "f32 or f64")->capture_default_str();
  app.add_option("--tolerance", a.tolerance, "On the relative residual; 0: run all iterations [1e-4, 1e-3]");
  app.add_option("--max-iterations", a.max_iterations, "Per environment, or of a step [1000, 50]");
  app.add_option("--envs", a.environments, "Environments of a scene")->check(whole_number(1))->capture_default_str();
  app.add_option("--steps", a.steps, "Steps of a scene")->check(whole_number(1))->capture_default_str();
  app.add_option("--seed", a.seed, "Seed of a scene")->check(whole_number())->capture_default_str();
  app.add_option("--json", a.json, "JSON report to write; - is standard output");
  app.add_flag("--quiet", a.quiet, "No progress, no summary");
}

void declare_all(CLI::App& app, Command& chosen) {
  app.set_version_flag("--version", std::string("stiction ") + kVersion);
  app.require_subcommand(1);
  add_command(app, chosen, "info", "Version, devices and why not, CPU features", run_info, declare_info);
  add_command(app, chosen, "generate", "Write a batch of a generated scene", run_generate, declare_generate);
  add_command(app, chosen, "inspect", "Sizes, cones, sparsity, colours, islands, warnings", run_inspect,
              declare_inspect);
  add_command(app, chosen, "solve", "Solve a batch", run_solve, declare_solve);
  add_command(app, chosen, "replay", "Solve what was recorded again and compare the bits", run_replay, declare_replay);
  add_command(app, chosen, "verify", "Recompute a solution's residual, apart from any solver", run_verify,
              declare_verify);
  add_command(app, chosen, "hash", "Hash of a solution's bits", run_hash, declare_hash);
  add_command(app, chosen, "diff", "First difference of two solutions, in ulps", run_diff, declare_diff);
  add_command(app, chosen, "merge", "Join the parts of a solution that shards wrote", run_merge, declare_merge);
  add_command(app, chosen, "convert", "FCLIB to contact batch and back", run_convert, declare_convert);
  add_command(app, chosen, "step", "Step environments of a scene of rigid bodies", run_step, declare_step);
  add_command(app, chosen, "scaling", "Strong and weak scaling over CPU threads", run_scaling, declare_scaling);
  app.footer(
      "view, report and step MODEL.xml are the Python package's, and are run by python3.\n"
      "Exit status: 0 done; 1 solved but an environment missed the tolerance, or a difference was found;\n"
      "2 bad input or usage.");
}

int run(int argc, char** argv) {
  if (is_python_command(argc, argv)) return run_python_command(argv);
  CLI::App app{"Batched frictional contact solver with the same bits on GPU and CPU", "stiction"};
  Command chosen;
  declare_all(app, chosen);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);  // --help, --version
    const auto is_meant = [&](const CLI::App* command) { return command->check_name(argv[1]); };
    const bool is_unknown = argc > 1 && argv[1][0] != '-' && std::as_const(app).get_subcommands(is_meant).empty();
    fmt::print(stderr, "stiction: {}; see stiction --help\n",
               is_unknown ? fmt::format("{}: there is no such command", argv[1]) : error.what());
    return kExitBadInput;
  }
  const int status = chosen();
  if (std::fflush(stdout) != 0) throw std::runtime_error("standard output cannot be written");
  return status;
}

}  // namespace

}  // namespace stiction::cli

int main(int argc, char** argv) {
  try {
    return stiction::cli::run(argc, argv);
  } catch (const std::bad_alloc&) {
    std::fputs("stiction: out of memory; use a smaller batch\n", stderr);
  } catch (const std::length_error&) {
    std::fputs("stiction: more than any memory holds; use a smaller batch\n", stderr);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "stiction: %s\n", error.what());
  }
  return stiction::cli::kExitBadInput;
}
