#pragma once

#include "core/algorithm/load/held_rows.hpp"
#include "core/algorithm/residual/final_residual.hpp"
#include "core/job/env_features.hpp"
#include "core/job/fallback_order.hpp"
#include "core/job/pivot_pairs.hpp"
#include "core/job/workspace.hpp"

/// Which solver an environment gets under SolverKind::automatic, and which one next if that one falls short. A function
/// of the environment alone; the table and where it comes from: docs/math/auto.md.
namespace stiction::inline STICTION_ISA {

/// Multiplications of a product with A.
template <class Real>
STICTION_HD Offset product_entries(const EnvView<Real>& env) {
  if (env.factor != nullptr) return Offset{2} * env.n * env.dofs;
  if (env.row_counts == nullptr) return env.entry_span();
  Offset entries = 0;
  for (Index row = 0; row < env.n; ++row) entries += env.row_counts[row];
  return entries;
}

template <Team TeamT, class Real>
STICTION_HD_OUTLINE EnvFeatures features(TeamT& team, const EnvView<Real>& env) {
  // Reciprocals and signs turn every minimum into a maximum, which is the one order-free reduction a team has.
  double largest = 0.0, inverse = 0.0, rigid = 0.0, flat = 0.0;
  Index friction_cones = 0;
  Index boxed_cones = 0;
  for (Index cone = 0; cone < env.cone_count; ++cone)
    if (carries_friction(env.kind[cone])) {
      ++friction_cones;
      boxed_cones += env.kind[cone] == ConeKind::box_friction ? 1 : 0;
    }
  for (Index cone = team.rank(); cone < env.cone_count; cone += team.size()) {
    const Index first = env.cone_row(cone);
    const Index size = env.cone_size(cone);
    const Index normal = env.row_of(first, size, 0);
    double diagonal = static_cast<double>(env.R[normal]);
    if (env.factor != nullptr) {
      const FactorRows<Real> rows{&env, nullptr};
      diagonal = rows.diagonal(normal, diagonal);
    } else {
      diagonal = row_diagonal(env, normal, diagonal);
    }
    if (diagonal > 0.0) {
      largest = max_(diagonal, largest);
      inverse = max_(div_(1.0, diagonal), inverse);
    } else if (env.kind[cone] != ConeKind::free && held_rows(env, cone) == 0) {
      flat = 1.0;
    }
    for (Index k = 0; k < size; ++k) {
      const Index i = env.row_of(first, size, k);
      const bool carries = row_scale(env, env.kind[cone], k, i) > Real(0);
      if (carries && !(env.R[i] > Real(0))) rigid = 1.0;
    }
  }
  EnvFeatures seen;
  seen.rows = env.n;
  seen.entries = product_entries(env);
  seen.friction_cones = friction_cones;
  seen.boxed_cones = boxed_cones;
  seen.axes = env.n - env.cone_count;
  seen.has_matrices = env.counts.semidefinite > 0;
  seen.spread = team.max(largest) * team.max(inverse);
  seen.is_pivots = team.max(flat) != 0.0;
  seen.is_compliant = team.max(rigid) == 0.0;
  seen.law = env.law;
  return seen;
}

/// The first guess becomes the answer so far, from which every stage starts.
template <Team TeamT, class Real>
STICTION_HD void begin_fallbacks(TeamT& team, const EnvView<Real>& env) {
  for_each(team, env.n, [&](Index i) { env.lambda[i] = env.warm_start == nullptr ? Real(0) : env.warm_start[i]; });
}

/// Returns true if a solver can treat such an environment at all.
STICTION_HD bool can_treat(SolverKind solver, const EnvFeatures& seen) {
  if (seen.has_matrices) {
    if (seen.is_pivots) return false;
    if (seen.boxed_cones > 0) return solver == SolverKind::jacobi;
    return solver == SolverKind::apgd || (solver == SolverKind::admm && seen.rows <= kDirectRows);
  }
  if (solver == SolverKind::jacobi) return false;
  if (seen.is_pivots && solver != SolverKind::lemke) return false;
  if (solver == SolverKind::subspace || solver == SolverKind::npgs) return true;
  if (seen.boxed_cones > 0)
    return solver == SolverKind::lemke && seen.boxed_cones == seen.friction_cones && !seen.is_pivots &&
           pairs_fit(seen.rows, seen.axes);
  if (solver == SolverKind::apgd) return true;
  if (seen.rows > kDirectRows) return false;
  return solver != SolverKind::lemke || seen.friction_cones == 0;
}

/// Returns true if it is smooth without the cones: Newton's method is best at it, and sweeps find it easy, too.
STICTION_HD bool is_smooth(const EnvFeatures& seen) {
  return seen.law == Law::convex && seen.is_compliant;
}

/// Returns true if an environment begins with splitting.
STICTION_HD bool begins_with_splitting(const EnvFeatures& seen) {
  constexpr double kSpreadForSplitting = 1e3;
  const bool is_spread = seen.spread > kSpreadForSplitting && !is_smooth(seen);
  return (is_spread || seen.has_matrices) && can_treat(SolverKind::admm, seen);
}

/// Returns true if an environment takes a turn when it comes to it.
STICTION_HD bool can_take(int turn, const EnvFeatures& seen) {
  const SolverKind solver = turn_solver(turn);
  const bool is_early = is_gradient_cheap(seen.rows, seen.entries) && !begins_with_splitting(seen);
  if (solver == SolverKind::apgd && is_early != (turn == kEarlyGradientTurn)) return false;
  return can_treat(solver, seen);
}

/// The turn that an environment begins with.
STICTION_HD int first_turn(const EnvFeatures& seen) {
  for (int turn = begins_with_splitting(seen) ? 1 : 0; turn < kFallbackTurns; ++turn)
    if (can_take(turn, seen)) return turn;
  return 0;
}

/// Returns true if a stage is left out between the first and the last ones, since a later one is certain where it is
/// not. If the problem is smooth, Newton's method comes without splitting. If it is a minimum all the same, the
/// interior point comes instead of Newton's method, and without splitting if there is no friction cone. Each then ends
/// in some ten factorisations.
STICTION_HD bool is_left_out(int stage, const EnvFeatures& seen) {
  const bool is_certain = is_smooth(seen) || seen.friction_cones == 0;
  if (stage == kSplittingStage) return is_certain;
  return stage == kNewtonStage && !is_smooth(seen) && (is_certain || seen.law == Law::convex);
}

/// The turn after `tried` that is for the environment, or `tried` itself if there is none.
STICTION_HD int next_turn(int tried, const EnvFeatures& seen) {
  for (int turn = tried + 1; turn < kFallbackTurns; ++turn)
    if (can_take(turn, seen) && !is_left_out(turn_stage(turn), seen)) return turn;
  return tried;
}

/// Returns true if another solver could improve the answer.
STICTION_HD bool falls_short(const EnvStatus& status) {
  return status.code == EnvCode::max_iterations || status.code == EnvCode::stalled || status.code == EnvCode::numerical;
}

}  // namespace stiction::inline STICTION_ISA
