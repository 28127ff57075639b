#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "cli/commands.hpp"
#include "distributed/subdomains/solve_by_consensus.hpp"
#include "distributed/transport/transport.hpp"
#include "stiction/types.hpp"

namespace stiction::distributed {

/// Exit status of a job that ended because a rank did not answer; the others are the command line's.
inline constexpr int kExitRankLost = 70;

struct SolveArguments {
  std::filesystem::path batch;  ///< or else a scene
  std::string scene;
  std::int64_t environments = 1;
  std::uint64_t seed = 0;
  int size = 0;  ///< 0: the scene's default
  std::string law = "file";
  std::string precision = "f64";
  double tolerance = 1e-4;
  Index max_iterations = 1000;
  double omega = 1.0;
  std::string partition = "bisection";
  std::string method = "si";   ///< or npgs, pgs, consensus, newton
  ConsensusOptions consensus;  ///< of that method; its subdomains are Newton's too
  Index first_sweeps = 48;     ///< of newton, before its first step
  double deadline = 60;        ///< longest wait for another rank [s]
  std::optional<std::filesystem::path> warm_start, output, json;
  bool quiet = false;
};

struct StepJobArguments {
  cli::StepArguments step;  ///< device, threads and preconditioner are not the user's; the solver sweeps
  std::string partition = "bisection";
  double deadline = 60;          ///< longest wait for another rank [s]
  std::string checkpoint_files;  ///< one or parts; empty: one where this program can
};

/// Steps a scene, contacts of each step by all ranks; rank 0 writes and prints. Returns an exit status.
/// \throws Error, RankLost
int run_step(Transport& transport, const StepJobArguments& arguments);

/// Solves over the ranks of a transport; rank 0 writes and prints. Returns an exit status. \throws Error, RankLost
int run_solve(Transport& transport, const SolveArguments& arguments);

}  // namespace stiction::distributed
