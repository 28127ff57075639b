#pragma once

#include "core/algorithm/solver/method.hpp"
#include "core/algorithm/sweep/sweep.hpp"

namespace stiction::inline STICTION_ISA {

/// Projected Gauss-Seidel by cones, relaxed by omega (docs/math/pgs.md; Jourdan, Alart, Jean 1998 for the Coulomb
/// form).
struct Pgs {
  static constexpr SolverKind kKind = SolverKind::pgs;
  static STICTION_HD constexpr Workspace workspace() { return {}; }
  static STICTION_HD constexpr bool needs_symmetry(Law) { return false; }
  /// True if it iterates on a SystemPair as well.
  static constexpr bool kTakesPairs = true;
  /// True if it can treat cones of box_friction.
  static constexpr bool kTakesBoxFriction = true;
  /// True if y is the motion of x after every iteration; if not, callers that need it compute it.
  template <class System>
  static constexpr bool kKeepsMotion = System::kMaintainsMotion;

  template <Law kLaw, Team TeamT, class System>
  static STICTION_HD void start(TeamT&, System&) {}

  template <Law kLaw, Team TeamT, class System>
  static STICTION_HD void iterate(TeamT& team, System& s, const MethodParams<Scalar<typename System::Real>>& params) {
    using Real = typename System::Real;
    sweep_by_law<kLaw>(team, s, Real(params.omega));
  }

  /// Recomputes maintained motion in the lanes of `due`.
  template <Team TeamT, class System>
  static STICTION_HD void refresh(TeamT& team, System& s, Mask<typename System::Real> due) {
    if constexpr (System::kMaintainsMotion) refresh_motion(team, s, due);
  }
};

}  // namespace stiction::inline STICTION_ISA
