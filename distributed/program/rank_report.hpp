#pragma once

#include <string>
#include <vector>

#include "cli/report.hpp"
#include "cli/step_report.hpp"
#include "distributed/newton/solve_by_newton.hpp"
#include "distributed/solve/solve_over_ranks.hpp"
#include "distributed/subdomains/solve_by_consensus.hpp"
#include "distributed/world/rank_world.hpp"

namespace stiction::distributed {

/// Report of `stiction-mpi solve`: that of `stiction solve`, and the work of its ranks.
struct JobReport {
  cli::SolveReport solve;
  std::string partition;
  std::string method = "si";
  ConsensusOptions consensus;  ///< of that method; its subdomains are Newton's too
  NewtonCounts newton;         ///< of that method
  Offset bodies = 0;
  std::vector<RankReport> ranks;
  std::vector<std::int64_t> peak_memory;  ///< of each rank's process, the most so far [bytes]
};

/// Work of one rank in all steps. Bodies, ghosts and near bodies are those of the last.
struct StepRankReport {
  RankReport solve;
  StepTraffic rest;
  std::int64_t peak_memory = 0;  ///< of its process, the most so far [bytes]
};
void add(RankReport& total, const RankReport& more);
void add(StepTraffic& total, const StepTraffic& more);

/// Report of `stiction-mpi step`.
struct StepJobReport {
  cli::StepReport step;
  std::string partition;
  std::vector<StepRankReport> ranks;
};

/// The JSON of docs/howto/ranks.md, closed by a line feed.
std::string to_json(const JobReport& report);
std::string to_json(const StepJobReport& report);
/// The table that is printed.
std::string to_text(const JobReport& report);
std::string to_text(const StepJobReport& report);

}  // namespace stiction::distributed
