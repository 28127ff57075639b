#pragma once

#include "distributed/program/commands.hpp"
#include "distributed/program/rank_report.hpp"

namespace stiction::distributed {

/// Scene of which each rank makes a slab of its own.
inline constexpr const char* kSlabs = "slabs";

/// Solves scene granular-column by sequential impulses, each rank the slab that it makes itself. No rank has more, and
/// so there is no solution file. Returns an exit status, and in `report` the ranks' work. \throws Error, RankLost
template <class Real>
int solve_column_slabs(Transport& transport, const SolveArguments& arguments, BodySolverOptions options,
                       JobReport& report);

}  // namespace stiction::distributed
