#pragma once

#include "core/body/sweep_body.hpp"

namespace stiction::inline STICTION_ISA {

/// Options of an iteration, as numbers of the solve's precision.
template <class Real>
struct MethodParams {
  Real omega;
};

/// Projected Gauss-Seidel by cones, relaxed by omega (docs/math/pgs.md; Jourdan, Alart, Jean 1998 for the Coulomb
/// form).
struct Pgs {
  static constexpr SolverKind kKind = SolverKind::pgs;
  static constexpr Index kVectors = 0;
  template <Law>
  static constexpr bool kNeedsSymmetry = false;
  /// Whether y is the motion of x after every iteration; if not, who wants to know it computes it.
  template <class System>
  static constexpr bool kKeepsMotion = System::kMaintainsMotion;

  template <Law kLaw, Block B, class System>
  static STICTION_HD void start(B&, System&) {}

  /// One iteration; `iteration` counts from 0 within a refresh interval.
  template <Law kLaw, Block B, class System>
  static STICTION_HD void iterate(B& block, System& s, const MethodParams<Scalar<typename System::Real>>& params,
                                  Index iteration) {
    using Real = typename System::Real;
    sweep<kLaw>(block, s, Real(params.omega));
    if constexpr (System::kMaintainsMotion)
      if (iteration + 1 == kRefreshInterval) refresh_motion(block, s);
  }
};

}  // namespace stiction::inline STICTION_ISA
