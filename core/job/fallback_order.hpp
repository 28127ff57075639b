#pragma once

#include "core/job/fallback_chain.hpp"

/// The order in which the stages of the fallback chain come (docs/math/auto.md).
namespace stiction {

/// One turn of the fallback chain.
struct FallbackTurn {
  SolverKind solver;
  double omega;  ///< what the caller's relaxation is multiplied by
  int stage;     ///< whose limit of iterations it has; below 0: the caller's, since nothing comes after it
};

/// A machine goes through these turns one after the other, whatever its environments. Gradients have two of them: an
/// environment takes the one before all stages that factorise, or the one after them. The last one is for those that no
/// stage can treat.
inline constexpr int kFallbackTurns = kFallbackStages + 2;
STICTION_HD constexpr FallbackTurn fallback_turn(int turn) {
  constexpr int kStages[kFallbackTurns] = {
      0, kGradientStage, kSplittingStage, kNewtonStage, kInteriorStage, kPivotingStage, kGradientStage, 6, 7, -1};
  const int stage = kStages[turn];
  if (stage < 0) return {SolverKind::jacobi, 1.0, stage};
  return {fallback_stage(stage).solver, fallback_stage(stage).omega, stage};
}
inline constexpr int kEarlyGradientTurn = 1;
inline constexpr int kJacobiTurn = kFallbackTurns - 1;
static_assert(fallback_turn(kEarlyGradientTurn).stage == kGradientStage);
static_assert(fallback_turn(kJacobiTurn).solver == SolverKind::jacobi);

/// Whether gradients may come before factorisations, where A has so many stored entries. Ten factorisations are the
/// fewest after which Newton's method and the interior point were seen to end. All iterations that gradients may have
/// must cost no more multiplications. So gradients that fail cost about what comes after them costs anyway, however it
/// ends.
STICTION_HD constexpr bool is_gradient_cheap(Index rows, Offset entries) {
  constexpr Offset kFewestFactorisations = 10;
  constexpr Offset kEntriesOfARow = 48;  // projections and vectors of an iteration cost so many entries of the product
  if (rows > kDirectRows) return false;
  const Offset gradients = fallback_stage(kGradientStage).iterations * (entries + kEntriesOfARow * rows);
  return 3 * gradients <= kFewestFactorisations * rows * rows * rows;  // of rows^3 / 3 multiplications each
}

/// Whether an environment of at most so many rows may have the early turn at all.
STICTION_HD constexpr bool may_take_early_gradients(Index most_rows) {
  return is_gradient_cheap(most_rows < kDirectRows ? most_rows : kDirectRows, 0);
}

}  // namespace stiction
