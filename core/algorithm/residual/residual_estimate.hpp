#pragma once

#include "core/algorithm/sweep/semidefinite_projection.hpp"
#include "core/algorithm/sweep/sweep.hpp"

namespace stiction::inline STICTION_ISA {

/// Square of the norm of ax - z, of a cone's rows that are ax and its projection z. Anything in ax or y that is not a
/// finite number counts as infinite: a projection would hide it. A correctly rounded root is monotone, so the largest
/// norm is the root of the largest square, bit for bit.
template <class Real, int M>
STICTION_HD Real square_of_map(const Real (&ax)[M], const Real (&z)[M], const Real (&y)[M]) {
  Real sum(0);
  Real largest(0);
  for (int k = 0; k < M; ++k) {
    const Real r = ax[k] - z[k];
    largest = max_(abs_(r), largest);
    sum = fma_(r, r, sum);
  }
  // Squares that vanish, as those of numbers below 2^-537 do, count as the smallest number: only r = 0 is 0. In single
  // precision this is an estimate only.
  if constexpr (sizeof(Scalar<Real>) == sizeof(double))
    sum = select(and_(sum == Real(0), largest > Real(0)), Real(0x1p-1074), sum);
  Real input(0);
  for (int k = 0; k < M; ++k) input = input + (ax[k] + y[k]);
  return select(and_(finite_(sum), finite_(input)), sum, Real(__builtin_huge_valf()));
}

/// Square of the norm of the natural map of one cone, a x - P(a x - y). Under the Coulomb law y has de Saxce's term
/// (docs/math/residual.md). A friction cone with lo < 0 has boxed friction: its tangential rows are bounded by the
/// normal reaction that x has. The cones are cones, so the weight a goes inside the projection and no division is
/// needed.
template <Law kLaw, class Shape, class Real, int M>
STICTION_HD Real natural_map_square(Shape shape, const Real (&x)[M], const Real (&y)[M], Real a, Real lo, Real hi) {
  Real ax[M];
  Real z[M];
  for (int k = 0; k < M; ++k) ax[k] = z[k] = a * x[k];
  proximal_point<kLaw>(shape, z, y, Real(1), a * lo, a * hi);
  if constexpr (Shape::kKind == ConeKind::friction) {
    if (const auto is_boxed = lo < Real(0); any(is_boxed)) {
      const Real normal = project_half_line(ax[0] - y[0]);
      const Real radius = project_half_line(ax[0]);
      z[0] = select(is_boxed, normal, z[0]);
      for (int k = 1; k < M; ++k) z[k] = select(is_boxed, clamp_(ax[k] - y[k], Real(0) - radius, radius), z[k]);
    }
  }
  return square_of_map(ax, z, y);
}

/// natural_map_square() of a cone of semidefinite.
template <class Real, int M>
STICTION_HD Real semidefinite_map_square(const Real (&x)[M], const Real (&y)[M], Real a) {
  Real ax[M];
  Real z[M];
  for (int k = 0; k < M; ++k) {
    ax[k] = a * x[k];
    z[k] = ax[k] - y[k];
  }
  project_semidefinite(z);
  return square_of_map(ax, z, y);
}

/// natural_map_square() of a cone of a system. kMatrices: it may be one of semidefinite.
template <bool kMatrices, Law kLaw, class Shape, class System, class Real, int M>
STICTION_HD Real cone_map_square(Shape shape, const System& s, Index cone, const Real (&x)[M], const Real (&y)[M],
                                 Real lo, Real hi) {
  if constexpr (kMatrices && kMayBeMatrix<Shape>) {
    if (is_semidefinite(shape, s, cone)) return semidefinite_map_square(x, y, s.residual_weight[cone]);
  }
  return natural_map_square<kLaw>(shape, x, y, s.residual_weight[cone], lo, hi);
}

/// The weight a of a cone in the natural map. Where the mean diagonal is not positive there is no exchange rate between
/// reaction and motion, and they are compared as numbers (docs/math/residual.md).
template <class Real>
STICTION_HD Real residual_weight(Real mean_diagonal) {
  return select(mean_diagonal > Real(0), mean_diagonal, Real(1));
}

/// update_best() of an iterate whose motion is known.
template <bool kMatrices, Law kLaw, Team TeamT, class System>
STICTION_HD_PART void record_iterate(TeamT& team, System& s, Mask<typename System::Real> due) {
  using Real = typename System::Real;
  Real largest(0);
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
    largest = max_(cone_map_square<kMatrices, kLaw>(shape, s, cone, x, y, lo, hi), largest);
  });
  const Real residual = div_(sqrt_(team.max(largest)), s.scalar[kNormB]);
  const auto better = and_(due, residual < s.scalar[kBestResidual]);
  if (any(better)) for_each(team, s.n, [&](Index i) { s.best[i] = select(better, s.x[i], s.best[i]); });
  team.sync();
  single(team, [&] {
    s.scalar[kBestResidual] = select(better, residual, s.scalar[kBestResidual]);
    s.scalar[kLastResidual] = select(due, residual, s.scalar[kLastResidual]);
  });
}

/// Records the current iterate in the lanes of `due`: its residual estimate and, where it is the smallest so far, the
/// iterate itself.
template <class Method, Law kLaw, Team TeamT, class System>
STICTION_HD_OUTLINE void update_best(TeamT& team, System& s, Mask<typename System::Real> due) {
  if constexpr (!Method::template kKeepsMotion<System>) refresh_motion(team, s);
  record_iterate<kTakesSemidefinite<Method> && kMayHaveSemidefinite<System>, kLaw>(team, s, due);
}

}  // namespace stiction::inline STICTION_ISA
