#pragma once

#include "core/base/method_room.hpp"

/// The ladder of SolverKind::automatic (docs/math/auto.md).
namespace stiction {

/// Rungs of the ladder, in the order in which they are climbed. None is left out of the order for an environment that
/// begins higher up.
inline constexpr int kRungs = 5;
STICTION_HD constexpr SolverKind ladder_rung(int rung) {
  constexpr SolverKind kLadder[kRungs] = {SolverKind::npgs, SolverKind::admm, SolverKind::newton, SolverKind::ipm,
                                          SolverKind::lemke};
  return kLadder[rung];
}

/// Iterations of a rung: what it needs when it works at all, so that a rung that does not work is left soon. Who may
/// iterate less than that iterates less.
STICTION_HD constexpr Index rung_iterations(SolverKind solver, Index allowed) {
  Index limit = 512;
  if (solver == SolverKind::admm) limit = 256;
  if (solver == SolverKind::newton) limit = 64;
  if (solver == SolverKind::ipm) limit = 128;
  if (solver == SolverKind::lemke) limit = 4 * kDirectRows;
  return limit < allowed ? limit : allowed;
}

}  // namespace stiction
