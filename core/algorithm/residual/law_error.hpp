#pragma once

#include "core/algorithm/problem/cone_shape.hpp"
#include "core/algorithm/sweep/semidefinite_projection.hpp"

/// The error of a contact, in units of its normal motion (docs/math/residual.md). By so much its reaction and its
/// motion must be changed until they obey its law.
namespace stiction::inline STICTION_ISA {

/// A cone's part of the diagonal d of A + R, in coordinates in which its friction cone is the unit cone. These are
/// x_k = lambda_k / mu_k and y_k = mu_k w_k. A reaction counts as the motion that it causes alone.
template <class Real, int M>
struct ConeMetric {
  Real a;         ///< d_n, or the row's largest entry where d_n is not positive [w / lambda]
  Real press[M];  ///< weight of (a x_k)^2: mu_k^2 d_k / d_n; 0 of an axis that has no friction or cannot move
  Real slip[M];   ///< weight of y_k^2: its inverse; 1 / mu_k^2 of a row that cannot move
};

/// Weights below this have no inverse and count as this. Axes of no larger weight and mu squared have no friction.
template <class Real>
inline constexpr double kLeastPress = sizeof(Scalar<Real>) == sizeof(float) ? 0x1p-120 : 0x1p-1000;

/// A larger ratio of a diagonal to the normal one counts as this, so that weights are numbers where the latter is tiny.
/// With an infinite square of mu they are not.
template <class Real>
inline constexpr double kMostRatio = 1.0 / kLeastPress<Real>;

/// The two weights of a further row of a friction cone. Rows that cannot move have the unit of the normal one.
template <class Real>
struct AxisWeights {
  Real press, slip;
};
/// `press`: where the row moves its weight, else mu^2.
template <class Real>
STICTION_HD AxisWeights<Real> axis_weights_of(Mask<Real> moves, Real press, Real mu) {
  const Real least(static_cast<Scalar<Real>>(kLeastPress<Real>));
  const auto counts = max_(mu * mu, press) > least;
  const Real weight = max_(press, least);
  return {select(and_(moves, counts), weight, Real(0)),
          select(counts, div_(Real(1), select(counts, weight, Real(1))), Real(0))};
}
/// `d`: of the row, before mu.
template <class Real>
STICTION_HD AxisWeights<Real> axis_weights(Real d_n, Real d, Real mu) {
  const auto moves = and_(d_n > Real(0), d > Real(0));
  const Real most(static_cast<Scalar<Real>>(kMostRatio<Real>));
  const Real press = (mu * mu) * select(moves, min_(div_(d, select(moves, d_n, Real(1))), most), Real(1));
  return axis_weights_of(moves, press, mu);
}

/// axis_weights() from the row's diagonal entry in the coordinates of the unit cone, mu^2 d.
template <class Real>
STICTION_HD AxisWeights<Real> unit_axis_weights(Real d_n, Real unit_d, Real mu) {
  const auto moves = and_(d_n > Real(0), unit_d > Real(0));
  const Real most(static_cast<Scalar<Real>>(kMostRatio<Real>));
  const Real ratio = div_(unit_d, select(moves, d_n, Real(1)));
  const Real press = select(moves, select(finite_(unit_d), min_(ratio, most), ratio), mu * mu);
  return axis_weights_of(moves, press, mu);
}

/// A bound as a motion: of a row that cannot move all that are not infinite are zero.
template <class Real>
STICTION_HD Real bound_as_motion(Real a, Real bound) {
  return select(finite_(bound), a * bound, bound);
}

/// The square of x's and y's distance from the law of a row between bounds: at the lower one, between, or at the upper.
/// `press` and `slip` weigh the squares of reaction and motion.
template <class Real>
STICTION_HD Real box_error_square(Real x, Real y, Real lo, Real hi, Real press, Real slip) {
  const Real inward = min_(y, Real(0)), outward = max_(y, Real(0));
  const Real below = x - lo, above = x - hi;
  const Real outside = select(below < Real(0), below, select(above > Real(0), above, Real(0)));
  const Real at_lo = fma_(slip * inward, inward, (press * below) * below);
  const Real at_hi = fma_(slip * outward, outward, (press * above) * above);
  const Real between = fma_(slip * y, y, (press * outside) * outside);
  return min_(at_lo, min_(at_hi, between));
}

/// Boxed friction: a unilateral normal, and beside it each axis between the bounds that the normal reaction gives it.
template <class Real, int M>
STICTION_HD_PART Real box_friction_error_square(const Real (&x)[M], const Real (&y)[M],
                                                const ConeMetric<Real, M>& metric) {
  const Real normal = metric.a * x[0];
  const Real radius = max_(normal, Real(0));
  Real sum = box_error_square(normal, y[0], Real(0), Real(__builtin_huge_valf()), Real(1), Real(1));
  for (int k = 1; k < M; ++k)
    sum = sum + box_error_square(metric.a * x[k], y[k], Real(0) - radius, radius, metric.press[k], metric.slip[k]);
  return sum;
}

/// The square of the distance from pairs that slide along `d`, a unit vector in the coordinates of the unit cone. Their
/// reaction is l (1, -d) and their motion c (g, d), with l and c >= 0. g is 0 under Coulomb's law, 1 under the convex
/// one.
template <Law kLaw, class Real, int M>
STICTION_HD Real sliding_error_square(const Real (&x)[M], const Real (&y)[M], const Real (&d)[M],
                                      const ConeMetric<Real, M>& metric) {
  Real push(0), pressed(0), way(0), moved(0);
  for (int k = 1; k < M; ++k) {
    const Real push_k = metric.press[k] * d[k], way_k = metric.slip[k] * d[k];
    push = fma_(push_k, d[k], push);
    pressed = fma_(push_k, x[k], pressed);
    way = fma_(way_k, d[k], way);
    moved = fma_(way_k, y[k], moved);
  }
  const Real l = max_(div_(x[0] - pressed, Real(1) + push), Real(0));
  Real c, off;
  if constexpr (kLaw == Law::coulomb) {
    c = max_(div_(moved, select(way > Real(0), way, Real(1))), Real(0));
    off = y[0];
  } else {
    c = max_(div_(y[0] + moved, Real(1) + way), Real(0));
    off = y[0] - c;
  }
  const Real lifted = x[0] - l;
  Real sum = fma_(lifted, lifted, off * off);
  for (int k = 1; k < M; ++k) {
    const Real x_k = fma_(l, d[k], x[k]), y_k = fma_(Real(0) - c, d[k], y[k]);
    sum = fma_(metric.press[k] * x_k, x_k, sum);
    sum = fma_(metric.slip[k] * y_k, y_k, sum);
  }
  return sum;
}

/// The distance of a contact with friction from the nearest member of its law's graph: open, sticking, sliding along
/// its motion, sliding against its reaction.
template <Law kLaw, class Real, int M>
STICTION_HD_PART Real friction_error_square(const Real (&x_unit)[M], const Real (&y_unit)[M],
                                            const ConeMetric<Real, M>& metric) {
  static_assert(kLaw != kLawOfSystem, "with_law() asks the system");
  constexpr auto kNone = __builtin_huge_valf();
  Real x[M];
  Real y[M];
  x[0] = metric.a * x_unit[0];
  y[0] = y_unit[0];
  // An axis without friction carries nothing in the batch's units, whatever an iterate has there.
  for (int k = 1; k < M; ++k) {
    const auto has_friction = metric.slip[k] > Real(0);
    x[k] = select(has_friction, metric.a * x_unit[k], Real(0));
    y[k] = select(has_friction, y_unit[k], Real(0));
  }
  Real reaction(0), friction(0), motion(0), slip(0);
  for (int k = 1; k < M; ++k) {
    friction = fma_(metric.press[k] * x[k], x[k], friction);
    reaction = fma_(x[k], x[k], reaction);
    motion = fma_(metric.slip[k] * y[k], y[k], motion);
    slip = fma_(y[k], y[k], slip);
  }
  const Real length = sqrt_(reaction), speed = sqrt_(slip);
  const auto has_friction = length > Real(0), moves = speed > Real(0);
  const Real open = kLaw == Law::coulomb ? min_(y[0], Real(0)) : min_(y[0] - speed, Real(0));
  const Real at_open = fma_(open, open, fma_(x[0], x[0], friction));

  const Real normal = max_(x[0], Real(0));
  const Real inward = select(length > normal, Real(1) - div_(normal, select(has_friction, length, Real(1))), Real(0));
  const Real pull = min_(x[0], Real(0));
  const Real at_rest = fma_(y[0], y[0], motion) + fma_(pull, pull, (inward * inward) * friction);
  Real least = min_(at_open, at_rest);

  Real d[M];
  const Real per_speed = div_(Real(1), select(moves, speed, Real(1)));
  d[0] = Real(0);
  for (int k = 1; k < M; ++k) d[k] = y[k] * per_speed;
  least = min_(select(moves, sliding_error_square<kLaw>(x, y, d, metric), Real(kNone)), least);
  const Real per_length = div_(Real(-1), select(has_friction, length, Real(1)));
  for (int k = 1; k < M; ++k) d[k] = x[k] * per_length;
  return min_(select(has_friction, sliding_error_square<kLaw>(x, y, d, metric), Real(kNone)), least);
}

/// Infinity unless all of x and y are finite: distances, which take the least of several, would hide a NaN.
template <class Real, int M>
STICTION_HD Real infinite_unless_finite(Real square, const Real (&x)[M], const Real (&y)[M]) {
  Real input = square;
  for (int k = 0; k < M; ++k) input = input + (x[k] + y[k]);
  return select(finite_(input), square, Real(__builtin_huge_valf()));
}

/// The square of a cone's error [w^2]. x and y are in the coordinates of the unit cone, bounds in units of x. A
/// friction cone with lo < 0 has boxed friction.
template <Law kLaw, class Shape, class Real, int M>
STICTION_HD Real law_error_square(Shape, const Real (&x)[M], const Real (&y)[M], const ConeMetric<Real, M>& metric,
                                  Real lo, Real hi) {
  Real square;
  if constexpr (Shape::kKind == ConeKind::friction) {
    const auto is_boxed = lo < Real(0);
    square = friction_error_square<kLaw>(x, y, metric);
    if (any(is_boxed)) square = select(is_boxed, box_friction_error_square(x, y, metric), square);
  } else if constexpr (Shape::kKind == ConeKind::free) {
    square = y[0] * y[0];
  } else if constexpr (Shape::kKind == ConeKind::unilateral) {
    square = box_error_square(metric.a * x[0], y[0], Real(0), Real(__builtin_huge_valf()), Real(1), Real(1));
  } else {
    square = box_error_square(metric.a * x[0], y[0], bound_as_motion(metric.a, lo), bound_as_motion(metric.a, hi),
                              Real(1), Real(1));
  }
  return infinite_unless_finite(square, x, y);
}

/// Error of a semidefinite cone, whose law (P, P - (x - y)) obeys, P the projection of x - y. a: mean diagonal.
template <class Real, int M>
STICTION_HD Real semidefinite_error_square(const Real (&x)[M], const Real (&y)[M], Real a) {
  Real z[M];
  for (int k = 0; k < M; ++k) z[k] = fma_(a, x[k], Real(0) - y[k]);
  project_semidefinite(z);
  Real sum(0);
  for (int k = 0; k < M; ++k) {
    const Real r = fma_(a, x[k], Real(0) - z[k]);
    sum = fma_(r, r, sum);
  }
  return infinite_unless_finite(Real(2) * sum, x, y);
}

/// An island's error scale is the largest error that one of its cones has without reactions. It is at least this share
/// of its largest |b|, so that an island whose contacts need nothing has one, too.
inline constexpr float kIdleShare = 1e-4F;
/// The share of an island whose scale is zero: its cones need nothing, and whatever they have is an error. Its square
/// has to be a number.
template <class Real>
inline constexpr double kIdleIsland = sizeof(Scalar<Real>) == sizeof(float) ? 0x1p60 : 0x1p500;

/// An error's weight in an island of that scale: the largest island's scale, `most`, over it.
template <class Real>
STICTION_HD Real island_share(Real most, Real scale) {
  const Real idle(static_cast<Scalar<Real>>(kIdleIsland<Real>));
  const auto counts = and_(scale > Real(0), most < idle * scale);
  return select(counts, div_(most, select(counts, scale, Real(1))), idle);
}

}  // namespace stiction::inline STICTION_ISA
