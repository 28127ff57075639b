#pragma once

#include "core/algorithm/derivative/cone_mode.hpp"

/// How reactions of a compliant cone follow the motion z of its rows under the convex law, in lanes
/// (docs/math/derivative.md, (34) and (35)).
namespace stiction::inline STICTION_ISA {

/// A cone at its answer, in the coordinates of the unit cone.
template <int kRows, class Wide>
struct SlopePoint {
  Wide x[kRows];
  Wide y[kRows];
  Wide mu[kRows];  ///< 1 of the normal
  Wide R[kRows];   ///< mu^2 R; positive where mu is
  Wide a;          ///< exchange rate [w / lambda]
};

/// T, minus the derivative of the reactions by z, in those coordinates:
///
///     T_nn = normal,  T_nt = -inverse q',  T_tt = diag(p) - bend q q'
template <int kRows, class Wide>
struct ReactionSlope {
  Wide normal;
  Wide inverse;
  Wide bend;
  Wide p[kRows];
  Wide q[kRows];
  Mask<Wide> slides;
  Wide unknowns;       ///< directions in which reactions can follow
  Mask<Wide> is_tied;  ///< between two modes
};

/// The modes are those of friction_directions(), ties too. Where a contact slides along d, reactions stay on the cone.
/// Their change is minimal in R and the curvature c = y_n / x_n. Eliminating the normal leaves a diagonal matrix and
/// one of rank one.
template <int kRows, class Wide>
STICTION_HD ReactionSlope<kRows, Wide> reaction_slope(const SlopePoint<kRows, Wide>& point, Wide tie) {
  Wide z[kRows];
  for (int k = 0; k < kRows; ++k) z[k] = point.a * point.x[k] - point.y[k];
  const Wide length = tangential_norm<kRows>(z);
  const Wide to_open = length + z[0], to_stick = length - z[0], minus_tie = Wide(0) - tie;
  const auto is_open = to_open <= tie;
  const auto sticks = and_(not_(is_open), to_stick <= tie);
  ReactionSlope<kRows, Wide> slope;
  slope.slides = not_(or_(is_open, sticks));
  slope.is_tied = or_(and_(is_open, to_open >= minus_tie), and_(sticks, to_stick >= minus_tie));
  const auto slides = slope.slides;
  const Wide curvature = div_(point.a * to_stick, select(slides, to_open, Wide(1)));
  Wide axes(0);
  Wide sum(0);
  Wide across(0);
  for (int k = 1; k < kRows; ++k) {
    const auto has_friction = point.mu[k] > Wide(0);
    const Wide d = div_(Wide(0) - z[k], select(slides, length, Wide(1)));
    const Wide stiffness = select(slides, point.R[k] + curvature, point.R[k]);
    const auto counts = and_(has_friction, not_(is_open));
    const Wide p = select(counts, div_(Wide(1), select(counts, stiffness, Wide(1))), Wide(0));
    const Wide q = select(slides, p * d, Wide(0));
    slope.p[k] = p;
    slope.q[k] = q;
    sum = fma_(q * d, point.R[k] + point.R[0], sum);
    across = fma_(q, d, across);
    axes = axes + select(has_friction, Wide(1), Wide(0));
  }
  slope.inverse = select(slides, div_(Wide(1), select(slides, sum, Wide(1))), Wide(0));
  slope.normal = select(slides, across * slope.inverse, select(sticks, div_(Wide(1), point.R[0]), Wide(0)));
  slope.bend = (point.R[0] - curvature) * slope.inverse;
  slope.unknowns = select(slides, axes, select(sticks, axes + Wide(1), Wide(0)));
  return slope;
}

/// A row between bounds, at its answer.
template <class Wide>
struct RowMode {
  Mask<Wide> moves;
  Mask<Wide> at_lo;
  Mask<Wide> at_hi;
  Mask<Wide> is_tied;
};
/// The modes are those of cone_directions(), ties too. A unilateral row's is open at a tie.
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

}  // namespace stiction::inline STICTION_ISA
