#pragma once

#include "stiction/solver.hpp"
#include "tests/fuzz/any_solver.hpp"
#include "tests/fuzz/bytes.hpp"

namespace stiction::fuzz {

/// Options that every solver takes, of few iterations on one thread, and that leave broken environments alone.
inline SolverOptions solver_options(Bytes& bytes) {
  constexpr double kTolerances[] = {1e-4, 0, 1e-12, 1e-8, 1e-2, 0.5};
  constexpr double kOmegas[] = {1, 0.25, 1.5, 1.9};
  constexpr Index kWindows[] = {2000, 0, 1, 5};
  constexpr Index kMostIterations = 30;
  SolverOptions options;
  options.solver = any_solver(bytes);
  options.tolerance = bytes.one_of(kTolerances);
  options.max_iterations = bytes.below(kMostIterations + 1);
  options.omega = bytes.one_of(kOmegas);
  options.stall_window = bytes.one_of(kWindows);
  options.islands = bytes.once_in(4) ? IslandMode::apart : IslandMode::together;
  options.threads = 1;
  options.invalid = InvalidPolicy::isolate;
  return options;
}

}  // namespace stiction::fuzz
