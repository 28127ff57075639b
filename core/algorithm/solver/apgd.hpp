#pragma once

#include "core/algorithm/solver/method.hpp"
#include "core/algorithm/sweep/nesterov.hpp"
#include "core/algorithm/sweep/sweep.hpp"

namespace stiction::inline STICTION_ISA {

/// Accelerated projected gradient with a block preconditioner, backtracking and adaptive restart. (docs/math/apgd.md;
/// Mazhar et al. 2015, with the metric D of the cones' blocks in place of the identity.) The gradient is a
/// quadratic's, so the descent condition is d'Ad <= L d'Dd for the step d. y at the new point is y + A d. An iteration
/// costs one product, and one more for every backtrack. Under the Coulomb law de Saxce's term joins the gradient and
/// the method is a fixed-point iteration instead of a descent.
struct Apgd {
  static constexpr SolverKind kKind = SolverKind::apgd;
  static STICTION_HD constexpr Workspace workspace() { return {.vectors = 6}; }
  /// Under the Coulomb law there is no function to descend, and nothing is lost by trying on an asymmetric A.
  static STICTION_HD constexpr bool needs_symmetry(Law law) { return law == Law::convex; }
  template <class System>
  static constexpr bool kKeepsMotion = true;
  static constexpr bool kProjectsMatrices = true;
  static constexpr int kTrials = 12;
  static constexpr float kGrow = 1.7F;
  static constexpr float kDecay = 0.97F;
  static constexpr float kSmallestLipschitz = 1.0F / 16;

  /// State between iterations.
  enum State : Index {
    kTheta = kMethodScalars,  ///< Nesterov's
    kLipschitz,               ///< current estimate of the preconditioned operator's norm
  };

  template <Law kLaw, Team TeamT, class System>
  static STICTION_HD void start(TeamT& team, System& s) {
    const auto x_before = s.vector(0);
    const auto y_before = s.vector(1);
    for_each(team, s.n, [&](Index i) {
      x_before[i] = s.x[i];
      y_before[i] = s.y[i];
    });
    single(team, [&] {
      s.scalar[kTheta] = 1;
      s.scalar[kLipschitz] = 1;
    });
  }

  template <Law kLaw, Team TeamT, class System>
  static STICTION_HD void iterate(TeamT& team, System& s, const MethodParams<Scalar<typename System::Real>>&) {
    using Real = typename System::Real;
    const auto x_before = s.vector(0);
    const auto y_before = s.vector(1);
    const auto point = s.vector(2);     // extrapolated iterate z
    const auto gradient = s.vector(3);  // its motion (A + R) z + b
    const auto d = s.vector(4);         // step x - z
    const auto image = s.vector(5);     // (A + R) d

    const NesterovStep<Real> lead = nesterov_step(Real(s.scalar[kTheta]));
    for_each(team, s.n, [&](Index i) {
      const Real x = s.x[i];
      const Real y = s.y[i];
      point[i] = fma_(lead.beta, x - x_before[i], x);
      gradient[i] = fma_(lead.beta, y - y_before[i], y);
      x_before[i] = x;
      y_before[i] = y;
    });

    // The lanes of a pack that pass at once recompute the same step with the same L while others backtrack.
    Real lipschitz = s.scalar[kLipschitz];
    for (int trial = 0; trial < kTrials; ++trial) {
      const Real inverse = div_(Real(1), lipschitz);
      s.for_each_cone(team, [&](auto shape, Index cone, Index row) {
        constexpr int kRows = decltype(shape)::kRows;
        Real z[kRows];
        Real y[kRows];
        for (int k = 0; k < kRows; ++k) {
          z[k] = point[row + k];
          y[k] = gradient[row + k];
        }
        cone_proximal_point<kLaw>(shape, s, cone, z, y, s.inv_cone[cone] * inverse, s.lo[cone], s.hi[cone]);
        for (int k = 0; k < kRows; ++k) {
          s.x[row + k] = z[k];
          d[row + k] = z[k] - point[row + k];
        }
      });
      s.multiply(team, d, [](Index) { return Real(0); }, [&](Index i, Real row) { image[i] = row; });
      const Real excess = s.sum_over_cones(team, [&](auto shape, Index cone, Index row) {
        Real curvature(0);
        Real length(0);
        for (int k = 0; k < decltype(shape)::kRows; ++k) {
          curvature = fma_(d[row + k], image[row + k], curvature);
          length = fma_(d[row + k], d[row + k], length);
        }
        const Real weight = select(s.inv_cone[cone] > Real(0), div_(lipschitz, s.inv_cone[cone]), Real(0));
        return curvature - weight * length;
      });
      const auto too_long = excess > Real(0);
      if (!any(too_long)) break;
      lipschitz = select(too_long, Real(kGrow) * lipschitz, lipschitz);
    }

    // Restart when the step from the last iterate goes uphill along the gradient at z.
    const Real slope = s.sum_over_cones(team, [&](auto shape, Index cone, Index row) {
      constexpr int kRows = decltype(shape)::kRows;
      Real g[kRows];
      for (int k = 0; k < kRows; ++k) g[k] = gradient[row + k];
      if constexpr (decltype(shape)::kKind == ConeKind::friction)
        if (law_of<kLaw>(s) == Law::coulomb && !is_semidefinite(shape, s, cone))
          g[0] = g[0] + tangential_norm<kRows>(g);
      Real sum(0);
      for (int k = 0; k < kRows; ++k) sum = fma_(g[k], s.x[row + k] - x_before[row + k], sum);
      return sum;
    });
    const auto restart = slope > Real(0);
    for_each(team, s.n, [&](Index i) { s.y[i] = gradient[i] + image[i]; });
    single(team, [&] {
      s.scalar[kTheta] = select(restart, Real(1), lead.next);
      s.scalar[kLipschitz] = max_(Real(kDecay) * lipschitz, Real(kSmallestLipschitz));
    });
  }

  template <Team TeamT, class System>
  static STICTION_HD void refresh(TeamT& team, System& s, Mask<typename System::Real> due) {
    refresh_motion(team, s, due, s.vector(1));
  }
};

}  // namespace stiction::inline STICTION_ISA
