#pragma once

#include "core/algorithm/residual/final_residual.hpp"
#include "core/job/env_features.hpp"
#include "core/job/fallback_chain.hpp"
#include "core/job/workspace.hpp"

/// Which solver an environment gets under SolverKind::automatic, and which one next if that one falls short. A function
/// of the environment alone; the table and where it comes from: docs/math/auto.md.
namespace stiction::inline STICTION_ISA {

template <Team TeamT, class Real>
STICTION_HD_OUTLINE EnvFeatures features(TeamT& team, const EnvView<Real>& env) {
  // Reciprocals and signs turn every minimum into a maximum, which is the one order-free reduction a team has.
  double largest = 0.0, inverse = 0.0, rigid = 0.0, flat = 0.0;
  Index friction_cones = 0;
  bool is_boxed = false;
  for (Index cone = 0; cone < env.cone_count; ++cone)
    if (carries_friction(env.kind[cone])) {
      ++friction_cones;
      is_boxed = is_boxed || env.kind[cone] == ConeKind::box_friction;
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
    } else if (env.kind[cone] != ConeKind::free) {
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
  seen.friction_cones = friction_cones;
  seen.is_boxed = is_boxed;
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

/// Whether a solver can treat such an environment at all.
STICTION_HD bool can_treat(SolverKind solver, const EnvFeatures& seen) {
  if (seen.has_matrices) {
    if (seen.is_boxed || seen.is_pivots) return false;
    return solver == SolverKind::apgd || (solver == SolverKind::admm && seen.rows <= kDirectRows);
  }
  if (seen.is_pivots && solver != SolverKind::lemke) return false;
  if (solver == SolverKind::subspace || solver == SolverKind::npgs) return true;
  if (seen.is_boxed) return false;
  if (solver == SolverKind::apgd) return true;
  if (seen.rows > kDirectRows) return false;
  return solver != SolverKind::lemke || seen.friction_cones == 0;
}

/// Whether it is a smooth problem without the cones: what Newton's method is best at, and sweeps find easy, too.
STICTION_HD bool is_smooth(const EnvFeatures& seen) {
  return seen.law == Law::convex && seen.is_compliant;
}

/// The stage that an environment begins on.
STICTION_HD int first_stage(const EnvFeatures& seen) {
  constexpr double kSpreadForSplitting = 1e3;
  const auto can_start_at = [&](int stage) { return can_treat(fallback_stage(stage).solver, seen); };
  if (seen.has_matrices) return can_start_at(kSplittingStage) ? kSplittingStage : kGradientStage;
  if (seen.is_pivots && can_start_at(kPivotingStage)) return kPivotingStage;
  if (seen.spread > kSpreadForSplitting && !is_smooth(seen) && can_start_at(kSplittingStage)) return kSplittingStage;
  return 0;
}

/// The stage after `tried` that can treat the environment, or `tried` itself if there is none. Where the problem is
/// smooth Newton's method comes right after sweeps. Where it is a minimum all the same the interior point comes
/// instead of it. It comes right after sweeps if there is no friction cone, else after splitting. Each then ends in
/// some ten factorisations.
STICTION_HD int next_stage(int tried, const EnvFeatures& seen) {
  const bool is_certain = seen.friction_cones == 0 || (seen.law == Law::convex && tried >= kSplittingStage);
  const int shortcut = is_smooth(seen) ? kNewtonStage : is_certain ? kInteriorStage : 0;
  if (tried < kNewtonStage && shortcut > tried && can_treat(fallback_stage(shortcut).solver, seen)) return shortcut;
  for (int stage = tried + 1; stage < kFallbackStages; ++stage)
    if (can_treat(fallback_stage(stage).solver, seen)) return stage;
  return tried;
}

/// Whether an answer leaves something to be wished for that another solver could give.
STICTION_HD bool falls_short(const EnvStatus& status) {
  return status.code == EnvCode::max_iterations || status.code == EnvCode::stalled || status.code == EnvCode::numerical;
}

}  // namespace stiction::inline STICTION_ISA
