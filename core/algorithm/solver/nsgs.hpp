#pragma once

#include "core/algorithm/solver/pgs.hpp"
#include "core/algorithm/sweep/exact_local_solve.hpp"

namespace stiction::inline STICTION_ISA {

/// Exact step of friction cones, for step_with_friction().
struct ExactConeStep {
  template <int M, class System>
  static STICTION_HD auto of(const System& s, Index cone, Index row, const typename System::Real (&y)[M],
                             typename System::Real omega) {
    return exact_coulomb_step<M>(s, cone, row, y, omega);
  }
};

/// A cone's step that solves Coulomb's law of a friction cone exactly. Single rows have that already.
struct ExactStep {
  template <Law kLaw, class Shape, class System>
  static STICTION_HD auto of(Shape shape, const System& s, Index cone, Index row,
                             const typename System::Real (&y)[Shape::kRows], typename System::Real omega) {
    if constexpr (Shape::kKind == ConeKind::friction) {
      return step_with_friction<ExactConeStep, Shape::kRows>(s, cone, row, y, omega);
    } else {
      return local_step<kLaw>(shape, s, cone, row, y, omega);
    }
  }
};

/// Nonsmooth Gauss-Seidel (docs/math/nsgs.md; Jourdan, Alart, Jean 1998). It makes sweeps as pgs does, with the exact
/// solution of each contact in place of a step towards it. Under the convex law the sweeps are pgs's.
struct Nsgs : Pgs {
  static constexpr SolverKind kKind = SolverKind::nsgs;

  template <Law kLaw, Team TeamT, class System>
  static STICTION_HD void iterate(TeamT& team, System& s, const MethodParams<Scalar<typename System::Real>>& params) {
    if (law_of<kLaw>(s) == Law::convex) {
      Pgs::iterate<kLaw>(team, s, params);
    } else {
      sweep<Law::coulomb, ExactStep>(team, s, typename System::Real(params.omega));
    }
  }
};

}  // namespace stiction::inline STICTION_ISA
