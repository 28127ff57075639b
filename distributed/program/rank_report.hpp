#pragma once

#include <string>
#include <vector>

#include "distributed/solve/solve_over_ranks.hpp"
#include "tools/cli/report.hpp"

namespace stiction::distributed {

/// What `stiction-mpi solve` reports: what `stiction solve` does, and what its ranks did.
struct JobReport {
  cli::SolveReport solve;
  std::string partition;
  Offset bodies = 0;
  std::vector<RankReport> ranks;
};

/// The JSON of docs/ranks.md, closed by a line feed.
std::string to_json(const JobReport& report);
/// The table that is printed.
std::string to_text(const JobReport& report);

}  // namespace stiction::distributed
