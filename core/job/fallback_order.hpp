#pragma once

#include <cstdint>

#include "core/job/fallback_chain.hpp"

/// The order in which the stages of the fallback chain come (docs/math/auto.md).
namespace stiction {

/// One turn of the fallback chain.
struct FallbackTurn {
  SolverKind solver;
  double omega;  ///< factor of the caller's relaxation
  int stage;     ///< whose limit of iterations it has; below 0: the caller's, since nothing comes after it
};

/// A machine goes through these turns one after the other, whatever its environments. Gradients have two of them: an
/// environment takes the one before all stages that factorise, or the one after them. The last one is for those that no
/// stage can treat.
inline constexpr int kFallbackTurns = kFallbackStages + 2;
inline constexpr int kEarlyGradientTurn = 1;
inline constexpr int kJacobiTurn = kFallbackTurns - 1;

/// The stage of a turn, -1 for the last. By counting: a GPU would write a table to its stack wherever this is asked.
STICTION_HD constexpr int turn_stage(int turn) {
  if (turn == kJacobiTurn) return -1;
  return turn == kEarlyGradientTurn ? kGradientStage : turn < kEarlyGradientTurn ? turn : turn - 1;
}

STICTION_HD constexpr FallbackTurn fallback_turn(int turn) {
  const int stage = turn_stage(turn);
  if (stage < 0) return {SolverKind::jacobi, 1.0, stage};
  return {fallback_stage(stage).solver, fallback_stage(stage).omega, stage};
}
static_assert(turn_stage(kEarlyGradientTurn) == kGradientStage);
static_assert(turn_stage(kGradientStage + 1) == kGradientStage);
static_assert(turn_stage(kJacobiTurn - 1) == kFallbackStages - 1);

/// The solvers of all turns, four bits each.
inline constexpr std::uint64_t kTurnSolvers = [] {
  static_assert(kSolverKindCount <= 16 && 4 * kFallbackTurns <= 64);
  std::uint64_t solvers = 0;
  for (int turn = 0; turn < kFallbackTurns; ++turn)
    solvers |= static_cast<std::uint64_t>(fallback_turn(turn).solver) << (4 * turn);
  return solvers;
}();
STICTION_HD constexpr SolverKind turn_solver(int turn) {
  return static_cast<SolverKind>((kTurnSolvers >> (4 * turn)) & 15U);
}

/// Returns true if gradients may come before factorisations, where A has so many stored entries. Ten factorisations
/// are the fewest after which Newton's method and the interior point were seen to end. All iterations that gradients
/// may have must cost no more multiplications. Gradients that fail hence cost about as much as their successors cost
/// anyway, however it ends.
STICTION_HD constexpr bool is_gradient_cheap(Index rows, Offset entries) {
  constexpr Offset kFewestFactorisations = 10;
  constexpr Offset kEntriesOfARow = 48;  // projections and vectors of an iteration cost so many entries of the product
  if (rows > kDirectRows) return false;
  const Offset gradients = fallback_stage(kGradientStage).iterations * (entries + kEntriesOfARow * rows);
  return 3 * gradients <= kFewestFactorisations * rows * rows * rows;  // of rows^3 / 3 multiplications each
}

/// Returns true if an environment of at most so many rows may have the early turn at all.
STICTION_HD constexpr bool may_take_early_gradients(Index most_rows) {
  return is_gradient_cheap(most_rows < kDirectRows ? most_rows : kDirectRows, 0);
}

}  // namespace stiction
