#pragma once

#include <string>
#include <vector>

#include "distributed/solve/solve_over_ranks.hpp"
#include "tools/cli/report.hpp"
#include "tools/cli/step_report.hpp"

namespace stiction::distributed {

/// What `stiction-mpi solve` reports: what `stiction solve` does, and what its ranks did.
struct JobReport {
  cli::SolveReport solve;
  std::string partition;
  Offset bodies = 0;
  std::vector<RankReport> ranks;
};

/// What `stiction-mpi step` reports. Bodies and ghosts of a rank are those of the last step, all else is of all steps.
struct StepJobReport {
  cli::StepReport step;
  std::string partition;
  std::vector<RankReport> ranks;
};

/// The JSON of docs/ranks.md, closed by a line feed.
std::string to_json(const JobReport& report);
std::string to_json(const StepJobReport& report);
/// The table that is printed.
std::string to_text(const JobReport& report);
std::string to_text(const StepJobReport& report);

}  // namespace stiction::distributed
