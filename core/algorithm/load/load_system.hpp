#pragma once

#include "core/algorithm/load/assemble.hpp"
#include "core/algorithm/load/asymmetry.hpp"
#include "core/algorithm/load/islands.hpp"
#include "core/algorithm/load/step_sizes.hpp"

/// From the batch's arrays to a system in the solver's coordinates, one lane at a time.
namespace stiction::inline STICTION_ISA {

/// The power of two that A is multiplied by.
template <class Real, class System>
STICTION_HD Real matrix_scale(const System&, Real largest_diagonal) {
  return unit_scale(largest_diagonal);
}
template <class Real>
STICTION_HD Real matrix_scale(const FactorSystem<Real>&, Real largest_diagonal) {
  const Real root = unit_scale(sqrt_(largest_diagonal));
  return root * root;
}

/// The numbers of a cone's row k, normal first, as the batch has them, with the row's scale in best. inv_cone becomes
/// 1: there is a cone.
template <class Real, class System>
STICTION_HD void load_row(const EnvView<Real>& env, System& s, Index cone, ConeSlot slot, Index k, Index i) {
  const ConeKind kind = env.kind[cone];
  const Index row = slot.row + k;
  s.b[row] = env.b[i];
  s.x[row] = env.warm_start != nullptr ? env.warm_start[i] : Real(0);
  s.best[row] = row_scale(env, kind, k, i);
  if (k == 0) {
    s.inv_cone[slot.cone] = 1;
    s.lo[slot.cone] = kind == ConeKind::box ? lower_bound(env, i) : kind == ConeKind::box_friction ? Real(-1) : Real(0);
    s.hi[slot.cone] = kind == ConeKind::box ? upper_bound(env, i) : kind == ConeKind::box_friction ? Real(1) : Real(0);
  }
}

/// Requirements of a method on the numbers it is given.
struct LoadRules {
  bool needs_symmetry;      ///< an asymmetric A is refused
  bool takes_any_diagonal;  ///< rows whose diagonal is not positive are not
};
/// A method that goes without the matrices it has for smaller environments takes conjugate gradients, for which A has
/// to be symmetric under any law.
template <class Method, class System>
STICTION_HD LoadRules load_rules(Law law, const System& s) {
  constexpr Workspace kWorkspace = Method::workspace();
  const bool takes_gradients = kWorkspace.matrix_free_vectors > 0 && !s.has_matrices;
  return {Method::needs_symmetry(law) || takes_gradients, requires { Method::kTakesAnyDiagonal; }};
}

/// Returns true if an environment that was found to be sound starts from its guess.
template <class Real>
STICTION_HD bool takes_warm_start(const EnvView<Real>& env, const Inspection<Real>& seen) {
  return env.warm_start != nullptr && (seen.flags & kFlagWarmStartRejected) == 0;
}

/// The scalars of an environment that has not begun.
template <class Real, class System>
STICTION_HD void start_scalars(System& s, const Inspection<Real>& seen) {
  const Real scale_b = unit_scale(seen.largest_b);
  s.scalar[kBestResidual] = s.scalar[kLastResidual] = static_cast<Real>(__builtin_huge_valf());
  s.scalar[kBestReaction] = Real(0);
  s.scalar[kErrorScale] = Real(1);
  s.scalar[kScaleA] = matrix_scale(s, seen.largest_diagonal);
  s.scalar[kScaleB] = scale_b;
  s.scalar[kOutcome] = Real(kRunning);
}

/// Brings one environment into the solver's coordinates: all that depends neither on the method nor on its law. Returns
/// the flags; with any but kHarmlessFlags set the system is not to be used.
template <Team TeamT, class Real, class System>
STICTION_HD_SHARED std::uint32_t load_system(TeamT& team, const EnvView<Real>& env, System& s, LoadRules rules) {
  for_each(team, s.cones, [&](Index c) {
    s.residual_weight[c] = s.press[c] = s.island[c] = s.shares[c] = s.inv_n[c] = s.inv_t[c] = s.inv_cone[c] =
        s.damping[c] = s.share[c] = s.lo[c] = s.hi[c] = 0;
  });
  s.law = env.law;
  s.has_blocks = env.block_visits > 1;
  const Inspection<Real> seen = inspect(team, env, s);
  std::uint32_t flags = rules.takes_any_diagonal ? seen.flags & ~kFlagBadDiagonal : seen.flags;
  if ((flags & ~kHarmlessFlags) != 0) return flags;
  single(team, [&] { start_scalars(s, seen); });
  const LoadScales<Real> scales = load_scales(s);
  assemble(team, env, s, scales.a);
  for_each(team, s.n, [&](Index i) { s.b[i] = s.x[i] = s.best[i] = s.axis_press[i] = s.axis_slip[i] = 0; });
  const bool warm = takes_warm_start(env, seen);
  for_each_slot(team, env, s, [&](Index cone, ConeSlot slot) {
    const Index first = env.cone_row(cone);
    const Index size = env.cone_size(cone);
    for (Index k = 0; k < size; ++k) {
      load_row(env, s, cone, slot, k, env.row_of(first, size, k));
      if (!warm) s.x[slot.row + k] = 0;
    }
    if (const unsigned held = seen.holds_rows ? held_rows(env, cone) : 0U; held != 0)
      hold_cone(env, s, cone, slot, held, scales);
    with_shape(env.kind[cone], size, [&](auto shape) {
      const bool is_matrix = kMayHaveSemidefinite<System> && env.kind[cone] == ConeKind::semidefinite;
      finish_cone(shape, s, slot.cone, slot.row, scales, true, env.law, is_matrix);
    });
    // Methods that take matrices project the guess themselves.
    if constexpr (kMayHaveSemidefinite<System>) {
      if (warm && env.kind[cone] == ConeKind::semidefinite)
        for (Index k = 0; k < size; ++k) s.x[slot.row + k] = env.warm_start[first + k] * scales.x;
    }
  });
  weigh_islands(team, env, s, [&](Index cone, ConeSlot) { return seen.holds_rows && held_rows(env, cone) != 0; });
  if (rules.needs_symmetry && asymmetry(team, s) > Real(kLargestAsymmetry)) return flags | kFlagAsymmetric;
  return flags;
}

/// Flags of an environment that a method cannot treat: one without a matrix, or by the method's own rule.
template <class Method, class Real, class System>
STICTION_HD std::uint32_t unsupported_flags(const EnvView<Real>& env, const System& s) {
  constexpr Workspace kWorkspace = Method::workspace();
  std::uint32_t flags =
      kWorkspace.dense_matrices > 0 && kWorkspace.matrix_free_vectors == 0 && !s.has_matrices ? kFlagOverCapacity : 0U;
  if constexpr (requires { Method::unsupported(s); }) flags |= Method::unsupported(s);
  if constexpr (!requires { requires Method::kTakesBoxFriction; })
    flags |= env.counts.box_friction > 0 ? kFlagUnsupportedCone : 0U;
  if constexpr (kMayHaveSemidefinite<System> && !kTakesSemidefinite<Method>)
    flags |= env.counts.semidefinite > 0 ? kFlagUnsupportedCone : 0U;
  return flags;
}

/// Starts the method on a system whose first iterate is recorded; it may first take numbers from the environment that
/// the system does not keep.
template <class Method, Law kLaw, Team TeamT, class Real, class System>
STICTION_HD void start_method(TeamT& team, const EnvView<Real>& env, System& s) {
  if constexpr (requires { Method::load(team, env, s); }) Method::load(team, env, s);
  Method::template start<kLaw>(team, s);
}

/// Moves the guess of cones of semidefinite into them.
template <Team TeamT, class System>
STICTION_HD_OUTLINE void project_guess(TeamT& team, System& s) {
  s.for_each_cone(team, [&](auto shape, Index cone, Index row) {
    if constexpr (kMayBeMatrix<decltype(shape)>) {
      if (!is_semidefinite(shape, s, cone)) return;
      constexpr int kRows = decltype(shape)::kRows;
      typename System::Real z[kRows];
      for (int k = 0; k < kRows; ++k) z[k] = s.x[row + k];
      project_semidefinite(z);
      for (int k = 0; k < kRows; ++k) s.x[row + k] = canonical_zero(z[k]);
    }
  });
}

/// Records the first iterate of a loaded system and starts the method.
template <class Method, Law kLaw, Team TeamT, class Real, class System>
STICTION_HD void begin_method(TeamT& team, const EnvView<Real>& env, System& s) {
  if constexpr (kTakesSemidefinite<Method> && kMayHaveSemidefinite<System>) project_guess(team, s);
  refresh_motion(team, s);
  for_each(team, s.n, [&](Index i) { s.best[i] = s.x[i]; });
  update_best<Method, kLaw>(team, s, true);
  start_method<Method, kLaw>(team, env, s);
}

/// Returns true if an environment with those flags can be solved.
STICTION_HD bool is_solvable(std::uint32_t flags) {
  return (flags & ~kHarmlessFlags) == 0;
}

/// Loads a system and begins the method. Returns the flags.
template <class Method, Law kLaw, Team TeamT, class Real, class System>
STICTION_HD std::uint32_t prepare(TeamT& team, const EnvView<Real>& env, System& s) {
  const std::uint32_t flags =
      load_system(team, env, s, load_rules<Method>(law_of<kLaw>(env), s)) | unsupported_flags<Method>(env, s);
  if (is_solvable(flags)) begin_method<Method, kLaw>(team, env, s);
  return flags;
}

}  // namespace stiction::inline STICTION_ISA
