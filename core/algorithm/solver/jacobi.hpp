#pragma once

#include "core/algorithm/solver/method.hpp"
#include "core/algorithm/sweep/sweep.hpp"

namespace stiction::inline STICTION_ISA {

/// Damped projected Jacobi: every cone takes a proximal step at once, with a step length that is safe without tuning
/// (docs/math/jacobi.md). For any positive z, d_i = (|A| z)_i / z_i makes diag(d) - A positive semidefinite (scaled
/// diagonal dominance). The iteration z <- |A| z tightens it towards the spectral radius of |A| (Collatz-Wielandt). A
/// cone uses the largest d of its rows. Maxima are exact, so no sum crosses lanes.
struct Jacobi {
  static constexpr SolverKind kKind = SolverKind::jacobi;
  static STICTION_HD constexpr Workspace workspace() { return {.vectors = 2}; }
  static STICTION_HD constexpr bool needs_symmetry(Law) { return false; }
  template <class System>
  static constexpr bool kKeepsMotion = true;
  static constexpr int kBoundIterations = 8;
  static constexpr bool kTakesBoxFriction = true;
  static constexpr bool kProjectsMatrices = true;

  /// Overwrites inv_cone by the safe step length of each cone. Starts from z = 1 / sqrt(diagonal), so that cones of
  /// different mass get different steps.
  template <Law kLaw, Team TeamT, class System>
  static STICTION_HD void start(TeamT& team, System& s) {
    using Real = typename System::Real;
    const auto z = s.vector(0);
    const auto image = s.vector(1);
    s.for_each_cone(team, [&](auto shape, Index cone, Index row) {
      for (int k = 0; k < decltype(shape)::kRows; ++k) {
        const Real diagonal = s.block_entry(row, k, k);
        const Real floored = max_(diagonal, Real(kSmallestRelative) * s.residual_weight[cone]);
        z[row + k] = select(floored > Real(0), div_(Real(1), sqrt_(floored)), Real(0));
      }
    });
    for (int pass = 0; pass < kBoundIterations; ++pass) {
      s.template multiply<true>(team, z, [](Index) { return Real(0); }, [&](Index i, Real row) { image[i] = row; });
      if (pass + 1 == kBoundIterations) break;
      s.for_each_cone(team, [&](auto shape, Index cone, Index row) {
        // In the metric of the diagonal the Perron iteration is z <- D^-1 |A| z; averaged with z against oscillation.
        for (int k = 0; k < decltype(shape)::kRows; ++k) {
          const Real diagonal = max_(s.block_entry(row, k, k), Real(kSmallestRelative) * s.residual_weight[cone]);
          const Real perron = select(diagonal > Real(0), div_(image[row + k], diagonal), Real(0));
          z[row + k] = Real(0.5) * (z[row + k] + perron);
        }
      });
      const Real scale = max_over<Real>(team, s.n, [&](Index i) { return z[i]; });
      const Real inverse = select(scale > Real(0), div_(Real(1), scale), Real(0));
      for_each(team, s.n, [&](Index i) { z[i] = z[i] * inverse; });
    }
    s.for_each_cone(team, [&](auto shape, Index cone, Index row) {
      Real bound(0);
      for (int k = 0; k < decltype(shape)::kRows; ++k) bound = max_(div_(image[row + k], z[row + k]), bound);
      s.inv_cone[cone] = select(bound > Real(0), div_(Real(1), bound), Real(0));
    });
  }

  template <Law kLaw, Team TeamT, class System>
  static STICTION_HD void iterate(TeamT& team, System& s, const MethodParams<Scalar<typename System::Real>>&) {
    using Real = typename System::Real;
    s.for_each_cone(team, [&](auto shape, Index cone, Index row) {
      constexpr int kRows = decltype(shape)::kRows;
      Real z[kRows];
      Real y[kRows];
      for (int k = 0; k < kRows; ++k) {
        z[k] = s.x[row + k];
        y[k] = s.y[row + k];
      }
      cone_proximal_point<kLaw>(shape, s, cone, z, y, s.inv_cone[cone], s.lo[cone], s.hi[cone]);
      box_proximal_point(s, cone, row, z, y, s.inv_cone[cone]);
      for (int k = 0; k < kRows; ++k) s.x[row + k] = z[k];
    });
    refresh_motion(team, s);
  }

  /// Motion is recomputed in every iteration.
  template <Team TeamT, class System>
  static STICTION_HD void refresh(TeamT&, System&, Mask<typename System::Real>) {}

  /// Floor of a diagonal entry relative to its cone's mean: keeps steps finite where a row couples to nothing.
  static constexpr float kSmallestRelative = 1.0F / (1 << 30);
};

}  // namespace stiction::inline STICTION_ISA
