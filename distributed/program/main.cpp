#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <new>
#include <span>
#include <string>
#include <vector>

#include "cli/commands.hpp"
#include "cli/step_options.hpp"
#include "cli/whole_number.hpp"
#include "distributed/program/commands.hpp"
#include "distributed/program/give_up.hpp"
#include "distributed/transport/mpi_transport.hpp"
#include "stiction/config.hpp"

namespace stiction::distributed {

namespace {

void declare_partition(CLI::App& app, const char* more, std::string& partition, double& deadline) {
  app.add_option("--partition", partition,
                 std::string("Owners of bodies: bisection, or random:SEED") + more + "; reaches no bit")
      ->capture_default_str();
  app.add_option("--deadline", deadline, "Longest wait for another rank in seconds")->capture_default_str();
}

void declare_solve(CLI::App& app, SolveArguments& a) {
  app.add_option("batch", a.batch, "Contact-batch file with J and M of rigid bodies");
  app.add_option("--scene", a.scene,
                 "A scene of stiction generate, or granular-column, made by every rank, in place of a file");
  app.add_option("--envs", a.environments, "Environments of the scene")
      ->check(cli::whole_number())
      ->capture_default_str();
  app.add_option("--seed", a.seed, "Seed of the scene")->check(cli::whole_number())->capture_default_str();
  app.add_option("--size", a.size, "Size of the scene (0: its default)")->check(cli::whole_number());
  app.add_option("--law", a.law, "file, convex or coulomb")->capture_default_str();
  app.add_option("--precision", a.precision, "f32 or f64")->capture_default_str();
  app.add_option("--tolerance", a.tolerance, "On the relative residual; 0: run all iterations")->capture_default_str();
  app.add_option("--max-iterations", a.max_iterations, "Sweeps of an environment at most, or Newton steps")
      ->capture_default_str();
  app.add_option("--omega", a.omega, "Relaxation, between 0 and 2")->capture_default_str();
  declare_partition(app, "; slabs: ranks make their part of granular-column", a.partition, a.deadline);
  app.add_option("--method", a.method,
                 "si or npgs, pgs: the bits of one process. consensus: few exchanges between subdomains. newton: high "
                 "accuracy")
      ->check(CLI::IsMember({"si", "npgs", "pgs", "consensus", "newton"}))
      ->capture_default_str();
  app.add_option("--subdomains", a.consensus.subdomains, "Of consensus and newton; they reach the bits, ranks do not")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  app.add_option("--sweeps", a.consensus.sweeps, "Of consensus, in a subdomain between two exchanges")
      ->capture_default_str();
  app.add_option("--first-sweeps", a.first_sweeps, "Of newton, by si before its first step; they reach the bits")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  app.add_option("--penalty", a.consensus.penalty, "Of consensus, the first, in units of a body's mass")
      ->capture_default_str();
  app.add_flag("--asynchronous", a.consensus.asynchronous,
               "Of consensus under the convex law: ranks do not wait, and bits are others each time");
  app.add_option("--warm-start", a.warm_start, "Solution file to start from");
  app.add_option("-o,--output", a.output, "Solution file to write");
  app.add_option("--json", a.json, "JSON report to write; - is standard output");
  app.add_flag("--quiet", a.quiet, "No summary");
}

void declare_step(CLI::App& app, StepJobArguments& job) {
  job.step.environments = 1;
  cli::declare_steps(app, job.step);
  app.add_option("--solver", job.step.solver, "si or npgs, pgs: the bits of one process")->capture_default_str();
  declare_partition(app, "", job.partition, job.deadline);
  app.add_option(
         "--checkpoint-files", job.checkpoint_files,
         "one, which all ranks write, or parts, one for each rank (default: one with parallel HDF5, else parts)")
      ->check(CLI::IsMember({"one", "parts"}));
}

int run(int argc, char** argv, int rank) {
  CLI::App app{"One scene over several processes, with the bits of one", "stiction-mpi"};
  app.set_version_flag("--version", std::string("stiction ") + kVersion);
  app.require_subcommand(1);
  SolveArguments solving;
  StepJobArguments stepping;
  const CLI::App& solve =
      *app.add_subcommand("solve", "Sequential impulses on rigid bodies that are dealt out to ranks");
  declare_solve(*app.get_subcommand("solve"), solving);
  declare_step(*app.add_subcommand("step", "Step a scene; contacts of each step are solved by all ranks"), stepping);
  app.footer(
      "Run it by mpirun -n RANKS. Exit status: 0 done; 1 an environment missed the tolerance; 2 bad input or usage;\n"
      "70 a rank did not answer.");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (rank == 0) {
      if (error.get_exit_code() == 0) return app.exit(error);  // --help, --version
      fmt::print(stderr, "stiction-mpi: {}; see stiction-mpi --help\n", error.what());
    }
    return error.get_exit_code() == 0 ? cli::kExitDone : cli::kExitBadInput;
  }
  const auto transport = mpi_transport(solve.parsed() ? solving.deadline : stepping.deadline);
  const int status = solve.parsed() ? run_solve(*transport, solving) : run_step(*transport, stepping);
  // All ranks end with one status, which mpirun passes on.
  std::vector<int> all(static_cast<std::size_t>(transport->size()));
  transport->all_gather(std::as_bytes(std::span(&status, 1)), std::as_writable_bytes(std::span(all)));
  return all.front();
}

}  // namespace

}  // namespace stiction::distributed

int main(int argc, char** argv) {
  namespace distributed = stiction::distributed;
  distributed::MpiSession session(&argc, &argv);
  const int rank = distributed::mpi_rank();
  try {
    return distributed::run(argc, argv, rank);
  } catch (const distributed::RankLost& lost) {
    distributed::give_up(rank, lost.what(), distributed::kExitRankLost);
  } catch (const std::bad_alloc&) {
    distributed::refuse(rank, "out of memory; use a smaller batch or more machines", stiction::cli::kExitBadInput);
  } catch (const std::exception& error) {
    distributed::refuse(rank, error.what(), stiction::cli::kExitBadInput);
  }
}
