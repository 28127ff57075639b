#pragma once

#include "core/algorithm/derivative/cone_mode.hpp"

/// Slope of a compliant cone's reactions by the motion z of its rows under the convex law, in lanes
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

/// A contact slides along d: reactions stay on the cone. Their change is minimal in R and the curvature
/// c = y_n / x_n. Eliminating the normal leaves a diagonal matrix and one of rank one.
template <int kRows, class Wide>
STICTION_HD ReactionSlope<kRows, Wide> reaction_slope(const SlopePoint<kRows, Wide>& point, Wide tie) {
  Wide z[kRows];
  for (int k = 0; k < kRows; ++k) z[k] = natural_point(point.a, point.x[k], point.y[k]);
  const Wide length = tangential_norm<kRows>(z);
  const FrictionMode<Wide> mode = friction_mode(z[0], length, tie);
  ReactionSlope<kRows, Wide> slope;
  slope.slides = mode.slides;
  slope.is_tied = mode.is_tied;
  const auto slides = mode.slides;
  const Wide curvature = sliding_curvature(mode, point.a);
  Wide axes(0);
  Wide sum(0);
  Wide across(0);
  for (int k = 1; k < kRows; ++k) {
    const auto has_friction = point.mu[k] > Wide(0);
    const Wide d = sliding_direction(mode, z[k], length);
    const Wide stiffness = select(slides, point.R[k] + curvature, point.R[k]);
    const auto counts = and_(has_friction, not_(mode.is_open));
    const Wide p = select(counts, div_(Wide(1), select(counts, stiffness, Wide(1))), Wide(0));
    const Wide q = select(slides, p * d, Wide(0));
    slope.p[k] = p;
    slope.q[k] = q;
    sum = fma_(q * d, point.R[k] + point.R[0], sum);
    across = fma_(q, d, across);
    axes = axes + select(has_friction, Wide(1), Wide(0));
  }
  slope.inverse = select(slides, div_(Wide(1), select(slides, sum, Wide(1))), Wide(0));
  slope.normal = select(slides, across * slope.inverse, select(mode.sticks, div_(Wide(1), point.R[0]), Wide(0)));
  slope.bend = (point.R[0] - curvature) * slope.inverse;
  slope.unknowns = select(slides, axes, select(mode.sticks, axes + Wide(1), Wide(0)));
  return slope;
}

}  // namespace stiction::inline STICTION_ISA
