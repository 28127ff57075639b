#pragma once

#include "core/job/workspace.hpp"

/// The fallback chain of SolverKind::automatic (docs/math/auto.md).
namespace stiction {

/// One stage of the fallback chain.
struct FallbackStage {
  SolverKind solver;
  Index iterations;  ///< its need when it works at all, so that a stage that does not work is left soon
  double omega;      ///< factor of the caller's relaxation
};

/// The fallback chain, in the order in which it is tried. None is left out of the order for an environment that begins
/// higher up. The last three are for environments that no other could solve. Gradients and sweeps are slow, but need
/// neither a matrix nor a start within a region of convergence. Newton's method follows from where they ended, with
/// three times the iterations.
inline constexpr int kFallbackStages = 8;
STICTION_HD constexpr FallbackStage fallback_stage(int stage) {
  constexpr FallbackStage kFallbackChain[kFallbackStages] = {{SolverKind::subspace, 512, 1.0},
                                                             {SolverKind::admm, 256, 1.0},
                                                             {SolverKind::newton, 64, 1.0},
                                                             {SolverKind::ipm, 128, 1.0},
                                                             {SolverKind::lemke, 4 * kDirectRows, 1.0},
                                                             {SolverKind::apgd, 4096, 1.0},
                                                             {SolverKind::npgs, 4096, 0.8},
                                                             {SolverKind::newton, 192, 1.0}};
  return kFallbackChain[stage];
}
inline constexpr int kSplittingStage = 1;
inline constexpr int kNewtonStage = 2;
inline constexpr int kInteriorStage = 3;
inline constexpr int kPivotingStage = 4;
inline constexpr int kGradientStage = 5;
static_assert(fallback_stage(kSplittingStage).solver == SolverKind::admm);
static_assert(fallback_stage(kNewtonStage).solver == SolverKind::newton);
static_assert(fallback_stage(kInteriorStage).solver == SolverKind::ipm);
static_assert(fallback_stage(kPivotingStage).solver == SolverKind::lemke);
static_assert(fallback_stage(kGradientStage).solver == SolverKind::apgd);

/// Iterations of a stage in an environment of `rows` rows; no more than are allowed. The more rows there are, the
/// longer sweeps go on, since each iteration of the later stages costs in the order of rows sweeps. There is no limit
/// if nothing that factorises comes after them.
STICTION_HD constexpr Index stage_iterations(int stage, Index rows, Index allowed) {
  constexpr Index kSweepsPerRow = 4;
  if (rows > kDirectRows) return allowed;
  Index limit = fallback_stage(stage).iterations;
  if (stage == 0 && limit < kSweepsPerRow * rows) limit = kSweepsPerRow * rows;
  return limit < allowed ? limit : allowed;
}

}  // namespace stiction
