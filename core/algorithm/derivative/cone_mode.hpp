#pragma once

#include "core/algorithm/problem/cone_projection.hpp"
#include "core/algorithm/problem/cone_shape.hpp"

/// In which directions the reactions of a cone can follow a change, and what of its motion then stays zero
/// (docs/math/derivative.md). All is decided by the point z = a x - y that the natural map projects.
namespace stiction::inline STICTION_ISA {

enum class ConeMode : Index {
  open = 0,      ///< no reaction
  sticking = 1,  ///< no motion
  sliding = 2,   ///< on the boundary of the friction cone, against the motion
  at_lo = 3,     ///< a box row at its lower bound
  at_hi = 4,     ///< a box row at its upper bound
};

/// A cone's reaction and motion in the coordinates of the unit cone.
template <int M>
struct ModePoint {
  double x[M];
  double y[M];   ///< without de Saxce's term
  double mu[M];  ///< 1 of the normal; 0 of an axis without friction
  double a;      ///< exchange rate [w / lambda]
  double lo;     ///< of a box row [lambda]
  double hi;
};

/// d lambda = E z and F' dw + D z = 0 for a cone's unknowns z, columns of E and F.
template <int M>
struct ConeDirections {
  ConeMode mode = ConeMode::open;
  bool is_degenerate = false;
  Index unknowns = 0;
  double E[M][M] = {};
  double F[M][M] = {};
  double D[M] = {};

  /// One more unknown: row k moves alone, and its motion stays zero.
  STICTION_HD void add(int k, double scale) {
    E[k][unknowns] = scale;
    F[k][unknowns] = scale;
    ++unknowns;
  }
};

template <int M>
STICTION_HD ConeDirections<M> single_row(bool moves, ConeMode mode, bool is_degenerate) {
  ConeDirections<M> found;
  found.mode = mode;
  found.is_degenerate = is_degenerate;
  if (moves) found.add(0, 1.0);
  return found;
}

/// An orthonormal complement of the unit vector d: that of a Householder reflection.
struct Complement {
  double sign;
  double scale;

  STICTION_HD explicit Complement(const double* d)
      : sign(d[0] < 0.0 ? -1.0 : 1.0), scale(div_(1.0, 1.0 + abs_(d[0]))) {}

  /// Component i of its vector j >= 1.
  [[nodiscard]] STICTION_HD double entry(const double* d, int i, int j) const {
    const double v = i == 0 ? d[0] + sign : d[i];
    return (i == j ? 1.0 : 0.0) - (v * d[j]) * scale;
  }
};

/// A cone that slides along d = z_t / -norm(z_t), with gaps as in friction_directions().
template <int M>
STICTION_HD void slide(const ModePoint<M>& point, Law law, const double (&z)[M], double length, double share,
                       ConeDirections<M>& found) {
  int axis[M];
  double d[M] = {};
  int axes = 0;
  for (int k = 1; k < M; ++k)
    if (point.mu[k] > 0.0) {
      axis[axes] = k;
      d[axes] = div_(0.0 - z[k], length);
      ++axes;
    }
  found.mode = ConeMode::sliding;
  found.unknowns = axes;
  found.E[0][0] = found.F[0][0] = 1.0;
  const Complement complement(d);
  for (int i = 0; i < axes; ++i) {
    const int k = axis[i];
    const double mu = point.mu[k];
    found.E[k][0] = 0.0 - mu * d[i];
    found.F[k][0] = law == Law::convex ? 0.0 - mu * d[i] : 0.0;
    for (int j = 1; j < axes; ++j) found.E[k][j] = found.F[k][j] = mu * complement.entry(d, i, j);
  }
  for (int j = 1; j < axes; ++j) found.D[j] = share;
}

template <int M>
STICTION_HD ConeDirections<M> friction_directions(const ModePoint<M>& point, Law law, double tie) {
  double z[M];
  double moved[M];
  for (int k = 0; k < M; ++k) {
    moved[k] = point.y[k];
    z[k] = point.a * point.x[k] - point.y[k];
  }
  if (law == Law::coulomb) z[0] = z[0] - tangential_norm<M>(moved);
  const double length = tangential_norm<M>(z);
  const double to_open = length + z[0];   // twice a x_n of a sliding contact
  const double to_stick = length - z[0];  // twice its speed
  ConeDirections<M> found;
  if (to_open <= tie) {
    found.is_degenerate = to_open >= 0.0 - tie;
  } else if (to_stick <= tie) {
    found.mode = ConeMode::sticking;
    found.is_degenerate = to_stick >= 0.0 - tie;
    for (int k = 0; k < M; ++k)
      if (point.mu[k] > 0.0) found.add(k, point.mu[k]);
  } else {
    slide(point, law, z, length, div_(point.a * to_stick, to_open), found);
  }
  return found;
}

/// The directions of a cone of that shape. `tie`: how far from another mode it is degenerate [w]. A tie goes to the
/// mode with a smaller reaction, and between sticking and sliding to sticking.
template <class Shape, int M>
STICTION_HD ConeDirections<M> cone_directions(Shape, const ModePoint<M>& point, Law law, double tie) {
  if constexpr (Shape::kKind == ConeKind::friction) {
    return friction_directions(point, law, tie);
  } else if constexpr (Shape::kKind == ConeKind::free) {
    return single_row<M>(true, ConeMode::sticking, false);
  } else if constexpr (Shape::kKind == ConeKind::unilateral) {
    const double z = point.a * point.x[0] - point.y[0];
    if (z <= tie) return single_row<M>(false, ConeMode::open, z >= 0.0 - tie);
    return single_row<M>(true, ConeMode::sticking, false);
  } else {
    const double z = point.a * point.x[0] - point.y[0];
    const double above_lo = z - point.a * point.lo;
    const double below_hi = point.a * point.hi - z;
    const bool near = abs_(above_lo) <= tie || abs_(below_hi) <= tie;
    const bool is_point = point.lo == point.hi;
    if (above_lo < 0.0 - tie || (is_point && above_lo <= tie)) return single_row<M>(false, ConeMode::at_lo, near);
    if (below_hi < 0.0 - tie || is_point) return single_row<M>(false, ConeMode::at_hi, near);
    return single_row<M>(true, ConeMode::sticking, near);
  }
}

}  // namespace stiction::inline STICTION_ISA
