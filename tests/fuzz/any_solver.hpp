#pragma once

#include "stiction/types.hpp"
#include "tests/fuzz/bytes.hpp"

namespace stiction::fuzz {

/// One of the solvers, or auto.
inline SolverKind any_solver(Bytes& bytes) {
  const int kind = bytes.below(kSolverKindCount + 1);
  return kind == kSolverKindCount ? SolverKind::automatic : static_cast<SolverKind>(kind);
}

}  // namespace stiction::fuzz
