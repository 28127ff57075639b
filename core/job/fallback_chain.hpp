#pragma once

#include "core/job/workspace.hpp"

/// The ladder of SolverKind::automatic (docs/math/auto.md).
namespace stiction {

/// One rung of the ladder.
struct Rung {
  SolverKind solver;
  Index iterations;  ///< what it needs when it works at all, so that a rung that does not work is left soon
  double omega;      ///< what the caller's relaxation is multiplied by
};

/// The ladder, in the order in which it is climbed. None is left out of the order for an environment that begins higher
/// up. The last three are for what no other could: gradients and sweeps, slow, but without a matrix and without a
/// region of convergence, and from where they came to rest Newton's method with patience.
inline constexpr int kLadderRungs = 8;
STICTION_HD constexpr Rung ladder_rung(int rung) {
  constexpr Rung kLadder[kLadderRungs] = {{SolverKind::subspace, 512, 1.0},
                                          {SolverKind::admm, 256, 1.0},
                                          {SolverKind::newton, 64, 1.0},
                                          {SolverKind::ipm, 128, 1.0},
                                          {SolverKind::lemke, 4 * kDirectRows, 1.0},
                                          {SolverKind::apgd, 4096, 1.0},
                                          {SolverKind::npgs, 4096, 0.8},
                                          {SolverKind::newton, 192, 1.0}};
  return kLadder[rung];
}
inline constexpr int kSplittingRung = 1;
inline constexpr int kNewtonRung = 2;
inline constexpr int kInteriorRung = 3;
inline constexpr int kPivotingRung = 4;
static_assert(ladder_rung(kSplittingRung).solver == SolverKind::admm);
static_assert(ladder_rung(kNewtonRung).solver == SolverKind::newton);
static_assert(ladder_rung(kInteriorRung).solver == SolverKind::ipm);
static_assert(ladder_rung(kPivotingRung).solver == SolverKind::lemke);

/// Iterations of a rung in an environment of `rows` rows. Who may iterate less than that iterates less. Sweeps are the
/// longer left to themselves the more rows there are, since what comes after them costs in the order of rows sweeps
/// each iteration; where nothing that factorises comes after them there is no limit.
STICTION_HD constexpr Index rung_iterations(int rung, Index rows, Index allowed) {
  constexpr Index kSweepsPerRow = 4;
  if (rows > kDirectRows) return allowed;
  Index limit = ladder_rung(rung).iterations;
  if (rung == 0 && limit < kSweepsPerRow * rows) limit = kSweepsPerRow * rows;
  return limit < allowed ? limit : allowed;
}

}  // namespace stiction
