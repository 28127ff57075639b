#pragma once

#include "stiction/solver.hpp"

namespace stiction {

/// \throws Error(invalid_argument) naming the first option out of range, its value and the remedy.
void check_options(const SolverOptions& options);

}  // namespace stiction
