#pragma once

#include "core/algorithm/derivative/cone_mode.hpp"

/// A cone whose reaction and motion have products kappa in place of zero (docs/math/derivative.md, (22) to (27)). Its
/// natural map becomes smooth, and a mode becomes a share between 0 and 1.
namespace stiction::inline STICTION_ISA {

/// p(t) = (t + sqrt(t² + 4c)) / 2, smooth in place of max(t, 0), at t and at -t. p(t) p(-t) = c (Chen and Harker 1993,
/// Kanzow 1996, Smale 1987). Nothing cancels.
struct SmoothStep {
  double above;    ///< p(t)
  double below;    ///< p(-t)
  double root;     ///< p(t) + p(-t)
  double opening;  ///< p'(t)
  double closing;  ///< 1 - p'(t)
};

STICTION_HD SmoothStep smooth_step(double t, double c) {
  SmoothStep step;
  step.root = sqrt_(fma_(t, t, 4.0 * c));
  const double larger = 0.5 * (abs_(t) + step.root);
  const double smaller = div_(c, larger);
  step.above = t < 0.0 ? smaller : larger;
  step.below = t < 0.0 ? larger : smaller;
  step.opening = div_(step.above, step.root);
  step.closing = div_(step.below, step.root);
  return step;
}

/// A cone of the relaxed problem at a point, by its unknowns.
template <int M>
struct RelaxedCone {
  ConeDirections<M> directions;
  double residual[M] = {};  ///< of the smooth natural map, along each unknown [w]
  double size = 0.0;        ///< of the numbers that it is a difference of [w]
  double lo_share = 0.0;    ///< how a box row follows its bounds
  double hi_share = 0.0;
};

/// No bound, and how far one may be to be one.
inline constexpr double kNoBound = __builtin_huge_val();
inline constexpr double kFarthestBound = 1e150;

/// A product below the range of double would leave no smooth map.
STICTION_HD double product_of(double a, double kappa) {
  return max_(a * kappa, 1e-200);
}

/// Data of an environment's relaxed problem beside its numbers.
struct Relaxing {
  Law law;
  double kappa;
  double scale;  ///< max|b|, by which De Saxce's term is rounded off
};

/// A row with bounds, of which each may be infinite. Both of them: its motion is zero, as that of a free row.
template <int M>
STICTION_HD RelaxedCone<M> relaxed_row(double x, double y, double a, double lo, double hi, double kappa) {
  const double c = product_of(a, kappa);
  const double z = natural_point(a, x, y);
  const bool has_lo = a * lo > 0.0 - kFarthestBound, has_hi = a * hi < kFarthestBound;
  double projected = z, by_lo = 0.0, by_hi = 0.0, opening = 1.0;
  if (has_lo && has_hi) {
    const SmoothStep low = smooth_step(z - a * lo, c), high = smooth_step(z - a * hi, c);
    projected = a * lo + (low.above - high.above);
    by_lo = low.closing;
    by_hi = high.opening;
    opening = low.opening - high.opening;
  } else if (has_lo) {
    const SmoothStep low = smooth_step(z - a * lo, c);
    projected = a * lo + low.above;
    by_lo = low.closing;
    opening = low.opening;
  } else if (has_hi) {
    const SmoothStep high = smooth_step(z - a * hi, c);
    projected = a * hi - high.below;
    by_hi = high.opening;
    opening = high.closing;
  }
  const double rest = by_lo + by_hi;
  RelaxedCone<M> found;
  found.directions.mode = ConeMode::sticking;
  found.directions.unknowns = 1;
  found.directions.E[0][0] = 1.0;
  found.directions.F[0][0] = max_(opening, 0.0);
  found.directions.D[0] = a * rest;
  found.residual[0] = a * x - projected;
  found.size = abs_(a * x) + abs_(y);
  if (rest > 0.0) {
    found.lo_share = div_(by_lo, rest);
    found.hi_share = div_(by_hi, rest);
  }
  return found;
}

/// A friction cone that carries something along an axis. Its unknowns are the projection's eigenvectors: (1, d) and
/// (1, -d) over sqrt(2) with d = z_t / norm(z_t), and an orthonormal complement of d.
template <int M>
STICTION_HD RelaxedCone<M> relaxed_friction(const ModePoint<M>& point, const Relaxing& relaxing) {
  constexpr double kHalfRoot = 0.70710678118654752440;
  const double c = product_of(point.a, relaxing.kappa);
  double z[M], moved[M], turn[M] = {};
  for (int k = 0; k < M; ++k) {
    moved[k] = point.y[k];
    z[k] = natural_point(point.a, point.x[k], point.y[k]);
  }
  if (relaxing.law == Law::coulomb) {
    // De Saxce's term is rounded off, so that it has a derivative where nothing moves.
    const double slip = tangential_norm<M>(moved);
    const double radius = div_(c, max_(relaxing.scale, sqrt_(c)));
    const double rounded = sqrt_(fma_(slip, slip, radius * radius));
    z[0] = z[0] - (rounded - radius);
    for (int k = 1; k < M; ++k) turn[k] = rounded > 0.0 ? div_(moved[k], rounded) : 0.0;
  }
  const double length = tangential_norm<M>(z);
  int axis[M];
  double d[M] = {};
  int axes = 0;
  for (int k = 1; k < M; ++k)
    if (point.mu[k] > 0.0) {
      axis[axes] = k;
      d[axes] = length > 0.0 ? div_(z[k], length) : (axes == 0 ? 1.0 : 0.0);
      ++axes;
    }
  const SmoothStep outer = smooth_step(z[0] + length, c), inner = smooth_step(z[0] - length, c);
  const double roots = outer.root + inner.root;
  const Complement complement(d);
  RelaxedCone<M> found;
  found.directions.mode = ConeMode::sliding;
  found.directions.unknowns = axes + 1;
  found.size = point.a * abs_(point.x[0]) + abs_(point.y[0]) + length;
  for (int j = 0; j <= axes; ++j) {
    const double opening = j == 0 ? outer.opening : j == 1 ? inner.opening : div_(outer.above + inner.above, roots);
    const double closing = j == 0 ? outer.closing : j == 1 ? inner.closing : div_(outer.below + inner.below, roots);
    const double normal = j < 2 ? kHalfRoot : 0.0;
    double along = normal * (point.a * point.x[0]);
    found.directions.E[0][j] = normal;
    found.directions.F[0][j] = normal * opening;
    for (int i = 0; i < axes; ++i) {
      const int k = axis[i];
      const double entry = j == 0 ? kHalfRoot * d[i] : j == 1 ? 0.0 - kHalfRoot * d[i] : complement.entry(d, i, j - 1);
      found.directions.E[k][j] = point.mu[k] * entry;
      found.directions.F[k][j] = point.mu[k] * (fma_(turn[k], normal, entry) * opening);
      along = fma_(entry, point.a * point.x[k], along);
    }
    found.directions.D[j] = point.a * closing;
    const double projected = j == 0 ? kHalfRoot * outer.above : j == 1 ? kHalfRoot * inner.above : 0.0;
    found.residual[j] = along - projected;
  }
  return found;
}

/// The relaxed cone of that shape.
template <class Shape, int M>
STICTION_HD RelaxedCone<M> relaxed_cone(Shape, const ModePoint<M>& point, const Relaxing& relaxing) {
  const double kappa = relaxing.kappa;
  if constexpr (Shape::kKind == ConeKind::friction) {
    bool has_friction = false;
    for (int k = 1; k < M; ++k) has_friction = has_friction || point.mu[k] > 0.0;
    if (has_friction) return relaxed_friction(point, relaxing);
    return relaxed_row<M>(point.x[0], point.y[0], point.a, 0.0, kNoBound, kappa);
  } else if constexpr (Shape::kKind == ConeKind::free) {
    return relaxed_row<M>(point.x[0], point.y[0], point.a, 0.0 - kNoBound, kNoBound, kappa);
  } else if constexpr (Shape::kKind == ConeKind::box) {
    return relaxed_row<M>(point.x[0], point.y[0], point.a, point.lo, point.hi, kappa);
  } else {
    return relaxed_row<M>(point.x[0], point.y[0], point.a, 0.0, kNoBound, kappa);
  }
}

}  // namespace stiction::inline STICTION_ISA
