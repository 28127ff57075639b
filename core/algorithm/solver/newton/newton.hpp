#pragma once

#include "core/algorithm/solver/newton/primal_newton.hpp"
#include "core/algorithm/solver/newton/proximal_newton.hpp"
#include "core/algorithm/system/cone_slots.hpp"

namespace stiction::inline STICTION_ISA {

/// Newton's method (docs/math/newton.md), on one of two problems. For the convex law with compliance on every row it
/// solves a smooth convex problem with an exact line search. MuJoCo's and SAP's solvers minimise the same over
/// velocities (Castro et al. 2022). Anything else: semismooth Newton on the natural map with a proximal term, in
/// alternation with sweeps.
struct Newton {
  static constexpr SolverKind kKind = SolverKind::newton;
  static STICTION_HD constexpr Workspace workspace() {
    return {.vectors = Npgs::workspace().vectors,
            .f64_vectors = kNewtonVectors,
            .dense_matrices = kNewtonMatrices,
            .matrix_free_vectors = kNewtonMatrixFreeVectors};
  }
  /// Under the Coulomb law there is no function to descend, and nothing is lost by trying on an asymmetric A.
  static STICTION_HD constexpr bool needs_symmetry(Law law) { return law == Law::convex; }
  template <class System>
  static constexpr bool kKeepsMotion = false;
  /// Compliance over a row's diagonal below which its reaction is too stiff a function of motion to be iterated on.
  static constexpr double kLeastCompliance = 0x1p-14;

  /// Keeps the compliance of every row in the system's order: a system has it only as a part of A + R. Zero for the
  /// tangential axes that have no friction.
  template <Team TeamT, class Real, class System>
  static STICTION_HD_OUTLINE void load(TeamT& team, const EnvView<Real>& env, System& s) {
    const NewtonWorkspace workspace = newton_room(s);
    const Real scale_a = s.scalar[kScaleA];
    for_each_slot(team, env, s, [&](Index cone, ConeSlot place) {
      const Index first = env.cone_row(cone);
      const Index size = env.cone_size(cone);
      for (Index k = 0; k < size; ++k) {
        const Index i = env.row_of(first, size, k);
        const Real scale = row_scale(env, env.kind[cone], k, i);
        workspace.vector(kCompliance)[place.row + k] = static_cast<double>((env.R[i] * scale_a) * (scale * scale));
      }
    });
  }

  template <Law kLaw, Team TeamT, class System>
  static STICTION_HD_OUTLINE void start(TeamT& team, System& s) {
    using Real = typename System::Real;
    if (law_of<kLaw>(s) == Law::convex && is_compliant(team, s)) {
      single(team, [&] {
        s.scalar[kProximalWeight] = Real(0);
        s.scalar[kWasExhausted] = Real(0);
      });
      start_primal(team, s);
    } else {
      start_proximal(team, s);
    }
  }

  template <Law kLaw, Team TeamT, class System>
  static STICTION_HD_OUTLINE void iterate(TeamT& team, System& s,
                                          const MethodParams<Scalar<typename System::Real>>& params) {
    using Real = typename System::Real;
    const bool is_primal = s.scalar[kProximalWeight] == Real(0);
    team.sync();
    bool is_exhausted = false;
    if (law_of<kLaw>(s) == Law::convex && is_primal) {
      // Twice in a row: the last step may still have gained half the digits.
      const bool was_exhausted = s.scalar[kWasExhausted] == Real(1);
      is_exhausted = iterate_primal(team, s);
      single(team, [&] { s.scalar[kWasExhausted] = is_exhausted ? Real(1) : Real(0); });
      is_exhausted = is_exhausted && was_exhausted;
    } else {
      is_exhausted = iterate_proximal<kLaw>(team, s, params);
    }
    if (is_exhausted) single(team, [&] { s.scalar[kOutcome] = Real(kFinished); });
  }

  template <Team TeamT, class System>
  static STICTION_HD void refresh(TeamT&, System&, Mask<typename System::Real>) {}

 private:
  /// Returns true if every row that can react has compliance to speak of.
  template <Team TeamT, class System>
  static STICTION_HD_OUTLINE bool is_compliant(TeamT& team, const System& s) {
    const NewtonWorkspace workspace = newton_room(s);
    double stiff = 0.0;
    s.for_each_cone(team, [&](auto shape, Index, Index row) {
      for (int k = 0; k < decltype(shape)::kRows; ++k) {
        const auto diagonal = static_cast<double>(s.block_entry(row, k, k));
        const bool without_friction = k > 0 && !(diagonal > 0.0);
        if (!without_friction && !(workspace.vector(kCompliance)[row + k] > kLeastCompliance * diagonal)) stiff = 1.0;
      }
    });
    return !(team.max(stiff) > 0.0);
  }
};

}  // namespace stiction::inline STICTION_ISA
