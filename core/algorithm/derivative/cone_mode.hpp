#pragma once

#include "core/algorithm/problem/cone_projection.hpp"
#include "core/algorithm/problem/cone_shape.hpp"

/// Directions in which the reactions of a cone can follow a change, and the parts of its motion that then stay zero
/// (docs/math/derivative.md). All is decided by the point z = a x - y that the natural map projects.
namespace stiction::inline STICTION_ISA {

enum class ConeMode : Index {
  open = 0,      ///< no reaction
  sticking = 1,  ///< no motion
  sliding = 2,   ///< on the boundary of the friction cone, against the motion
  at_lo = 3,     ///< a box row at its lower bound
  at_hi = 4,     ///< a box row at its upper bound
};

/// A component of the point that the natural map projects, without de Saxce's term (docs/math/derivative.md, (1)).
template <class Wide>
STICTION_HD Wide natural_point(Wide a, Wide x, Wide y) {
  return a * x - y;
}

/// The mode of a friction cone, of one environment or of environments side by side.
template <class Wide>
struct FrictionMode {
  Wide to_open;   ///< twice a x_n of a sliding contact
  Wide to_stick;  ///< twice its speed
  Mask<Wide> is_open;
  Mask<Wide> sticks;
  Mask<Wide> slides;
  Mask<Wide> is_tied;  ///< between two modes
};
/// By the normal component of z and the length of the others. `tie`: how far from another mode it is degenerate [w]. A
/// tie goes to the mode with a smaller reaction, and between sticking and sliding to sticking.
template <class Wide>
STICTION_HD FrictionMode<Wide> friction_mode(Wide z_n, Wide length, Wide tie) {
  const Wide minus_tie = Wide(0) - tie;
  FrictionMode<Wide> mode;
  mode.to_open = length + z_n;
  mode.to_stick = length - z_n;
  mode.is_open = mode.to_open <= tie;
  mode.sticks = and_(not_(mode.is_open), mode.to_stick <= tie);
  mode.slides = not_(or_(mode.is_open, mode.sticks));
  mode.is_tied = or_(and_(mode.is_open, mode.to_open >= minus_tie), and_(mode.sticks, mode.to_stick >= minus_tie));
  return mode;
}
/// norm(y_t) / x_n of a cone that slides.
template <class Wide>
STICTION_HD Wide sliding_curvature(const FrictionMode<Wide>& mode, Wide a) {
  return div_(a * mode.to_stick, select(mode.slides, mode.to_open, Wide(1)));
}
/// A component of d, the direction of its motion, from that of z.
template <class Wide>
STICTION_HD Wide sliding_direction(const FrictionMode<Wide>& mode, Wide z, Wide length) {
  return div_(Wide(0) - z, select(mode.slides, length, Wide(1)));
}

/// The mode of a row between bounds. A unilateral row's are 0 and infinity.
template <class Wide>
struct RowMode {
  Mask<Wide> moves;
  Mask<Wide> at_lo;
  Mask<Wide> at_hi;
  Mask<Wide> is_tied;
};
/// Ties as in friction_mode(): a unilateral row's is open, a box row's moves.
template <class Wide>
STICTION_HD RowMode<Wide> row_mode(Wide z, Wide a, Wide lo, Wide hi, Mask<Wide> is_unilateral, Wide tie) {
  const Wide minus_tie = Wide(0) - tie;
  const Wide above_lo = z - a * lo, below_hi = a * hi - z;
  const auto near_lo = and_(above_lo <= tie, above_lo >= minus_tie);
  const auto near_hi = and_(below_hi <= tie, below_hi >= minus_tie);
  const auto is_point = lo == hi;
  const auto is_below = and_(above_lo <= tie, or_(above_lo < minus_tie, or_(is_point, is_unilateral)));
  const auto is_above = and_(not_(is_below), or_(below_hi < minus_tie, is_point));
  return {not_(or_(is_below, is_above)), is_below, is_above, or_(near_lo, near_hi)};
}

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

/// A cone that slides, with gaps as in friction_directions().
template <int M>
STICTION_HD void slide(const ModePoint<M>& point, Law law, const double (&z)[M], double length,
                       const FrictionMode<double>& mode, ConeDirections<M>& found) {
  int axis[M];
  double d[M] = {};
  int axes = 0;
  for (int k = 1; k < M; ++k)
    if (point.mu[k] > 0.0) {
      axis[axes] = k;
      d[axes] = sliding_direction(mode, z[k], length);
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
  const double curvature = sliding_curvature(mode, point.a);
  for (int j = 1; j < axes; ++j) found.D[j] = curvature;
}

template <int M>
STICTION_HD ConeDirections<M> friction_directions(const ModePoint<M>& point, Law law, double tie) {
  double z[M];
  double moved[M];
  for (int k = 0; k < M; ++k) {
    moved[k] = point.y[k];
    z[k] = natural_point(point.a, point.x[k], point.y[k]);
  }
  if (law == Law::coulomb) z[0] = z[0] - tangential_norm<M>(moved);
  const double length = tangential_norm<M>(z);
  const FrictionMode<double> mode = friction_mode(z[0], length, tie);
  ConeDirections<M> found;
  found.is_degenerate = mode.is_tied;
  if (mode.sticks) {
    found.mode = ConeMode::sticking;
    for (int k = 0; k < M; ++k)
      if (point.mu[k] > 0.0) found.add(k, point.mu[k]);
  } else if (mode.slides) {
    slide(point, law, z, length, mode, found);
  }
  return found;
}

/// The directions of a cone of that shape; `tie` as in friction_mode().
template <class Shape, int M>
STICTION_HD ConeDirections<M> cone_directions(Shape, const ModePoint<M>& point, Law law, double tie) {
  if constexpr (Shape::kKind == ConeKind::friction) {
    return friction_directions(point, law, tie);
  } else if constexpr (Shape::kKind == ConeKind::free) {
    return single_row<M>(true, ConeMode::sticking, false);
  } else {
    constexpr bool kUnilateral = Shape::kKind == ConeKind::unilateral;
    const double hi = kUnilateral ? __builtin_huge_val() : point.hi;
    const RowMode<double> mode =
        row_mode(natural_point(point.a, point.x[0], point.y[0]), point.a, point.lo, hi, kUnilateral, tie);
    ConeMode name = ConeMode::sticking;
    if (mode.at_lo) name = kUnilateral ? ConeMode::open : ConeMode::at_lo;
    if (mode.at_hi) name = ConeMode::at_hi;
    return single_row<M>(mode.moves, name, mode.is_tied);
  }
}

}  // namespace stiction::inline STICTION_ISA
