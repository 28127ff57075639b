#pragma once

#include "core/algorithm/residual/law_error.hpp"
#include "core/algorithm/sweep/semidefinite_projection.hpp"
#include "core/algorithm/sweep/sweep.hpp"

namespace stiction::inline STICTION_ISA {

/// Weight of a cone's changes in units of w: the mean diagonal of its block, 1 where that is not positive.
template <class Real>
STICTION_HD Real residual_weight(Real mean_diagonal) {
  return select(mean_diagonal > Real(0), mean_diagonal, Real(1));
}

/// The square of the error of a system's cone, in its own coordinates. kMatrices: it may be one of semidefinite.
template <bool kMatrices, Law kLaw, class Shape, class System, class Real, int M>
STICTION_HD Real cone_error_square(Shape shape, const System& s, Index cone, Index row, const Real (&x)[M],
                                   const Real (&y)[M], Real lo, Real hi) {
  if constexpr (kMatrices && kMayBeMatrix<Shape>) {
    if (is_semidefinite(shape, s, cone)) return semidefinite_error_square(x, y, s.residual_weight[cone]);
  }
  ConeMetric<Real, M> metric;
  metric.a = s.press[cone];
  for (int k = 0; k < M; ++k) {
    metric.press[k] = k == 0 ? Real(1) : s.axis_press[row + k];
    metric.slip[k] = k == 0 ? Real(1) : s.axis_slip[row + k];
  }
  return law_error_square<kLaw>(shape, x, y, metric, lo, hi);
}

/// update_best() of an iterate whose motion is known.
template <bool kMatrices, Law kLaw, Team TeamT, class System>
STICTION_HD_PART void record_iterate(TeamT& team, System& s, Mask<typename System::Real> due) {
  using Real = typename System::Real;
  Real largest(0);
  Real pressed(0);
  const bool is_boxed = has_box_friction(s);
  s.for_each_cone(team, [&](auto shape, Index cone, Index row) {
    constexpr int kRows = decltype(shape)::kRows;
    Real x[kRows];
    Real y[kRows];
    for (int k = 0; k < kRows; ++k) {
      x[k] = s.x[row + k];
      y[k] = s.y[row + k];
    }
    const bool is_bounded = decltype(shape)::kKind == ConeKind::box || (kRows > 1 && is_boxed);
    const Real lo = is_bounded ? s.lo[cone] : Real(0);
    const Real hi = is_bounded ? s.hi[cone] : Real(0);
    const Real share = s.island[cone];
    largest = max_((cone_error_square<kMatrices, kLaw>(shape, s, cone, row, x, y, lo, hi) * share) * share, largest);
    pressed = max_(abs_(s.press[cone] * x[0]) * share, pressed);
  });
  const Real scale = s.scalar[kErrorScale];
  const Real residual = div_(sqrt_(team.max(largest)), scale);
  const Real reaction = div_(team.max(pressed), scale);
  const auto better = and_(due, residual < s.scalar[kBestResidual]);
  if (any(better)) for_each(team, s.n, [&](Index i) { s.best[i] = select(better, s.x[i], s.best[i]); });
  team.sync();
  single(team, [&] {
    s.scalar[kBestResidual] = select(better, residual, s.scalar[kBestResidual]);
    s.scalar[kBestReaction] = select(better, reaction, s.scalar[kBestReaction]);
    s.scalar[kLastResidual] = select(due, residual, s.scalar[kLastResidual]);
  });
}

/// Records the current iterate in the lanes of `due`: its residual estimate and, where it is the smallest so far, the
/// iterate itself.
template <class Method, Law kLaw, Team TeamT, class System>
STICTION_HD_OUTLINE void update_best(TeamT& team, System& s, Mask<typename System::Real> due) {
  if constexpr (!Method::template kKeepsMotion<System>) refresh_motion(team, s);
  constexpr bool kMatrices = kTakesSemidefinite<Method> && kMayHaveSemidefinite<System>;
  if constexpr (kLaw == kLawOfSystem) {
    with_law<kLaw>(s, [&](auto law) { record_iterate<kMatrices, decltype(law)::value>(team, without_matrix(s), due); });
  } else {  // the system itself: a device keeps its addresses in registers
    record_iterate<kMatrices, kLaw>(team, s, due);
  }
}

}  // namespace stiction::inline STICTION_ISA
