#pragma once

#include "core/algorithm/problem/cone_projection.hpp"
#include "core/algorithm/velocity/lane_array.hpp"
#include "stiction/types.hpp"

/// Reactions as functions of the motion z of their cone's rows, and their slopes. The reaction lambda is the nearest
/// point of the cone to -z / R in the metric R. It is minus the gradient of a convex potential of z
/// (docs/math/velocity_newton.md, "Potentials of cones").
namespace stiction::inline STICTION_ISA {

/// The larger of a compliance and `least` of the diagonal that A has there; 1 where neither is positive.
template <class Wide>
STICTION_HD Wide raised_compliance(Wide diagonal, Wide given, double least) {
  const Wide raised = max_(Wide(least) * diagonal, given);
  return select(raised > Wide(0), raised, Wide(1));
}

/// A row between bounds: free and unilateral rows have infinite ones.
template <class Wide>
struct RowLaw {
  Wide inverse;  ///< 1 / R
  Wide lo;
  Wide hi;
};
/// Reaction of a row, and minus its slope.
template <class Wide>
struct RowReaction {
  Wide x;
  Wide slope;
};
template <class Wide>
STICTION_HD RowReaction<Wide> row_reaction(const RowLaw<Wide>& law, Wide z) {
  const Wide u = Wide(0) - z * law.inverse;
  const auto is_inside = and_(u > law.lo, u < law.hi);
  return {clamp_(u, law.lo, law.hi), select(is_inside, law.inverse, Wide(0))};
}

/// A friction cone in the coordinates of the unit cone: one compliance for the normal, one for all tangential axes.
template <class Wide>
struct ConeLaw {
  Wide inverse_normal;      ///< 1 / R_n
  Wide inverse_tangential;  ///< 1 / R_t
  Wide inverse_sum;         ///< 1 / (R_n + R_t)
};
/// Reaction (x_n, -across * z_t), and minus its derivative G, which with the unit vector d of -z_t is
///
///     G_nn = normal,  G_nt = slide d',  G_tt = across I + bend d d'
template <class Wide>
struct ConeReaction {
  Wide x_n;
  Wide across;
  Wide normal;
  Wide slide;
  Wide bend;
  Wide inverse_length;  ///< 1 / norm(z_t), 1 where that is 0
};
template <class Wide>
STICTION_HD ConeReaction<Wide> cone_reaction(const ConeLaw<Wide>& law, Wide z_n, Wide length) {
  const Wide u_n = Wide(0) - z_n * law.inverse_normal;
  const auto sticks = length * law.inverse_tangential <= u_n;
  const auto is_open = z_n >= length;
  const auto slides = not_(or_(sticks, is_open));
  const Wide inverse_length = div_(Wide(1), select(length > Wide(0), length, Wide(1)));
  const Wide edge = (length - z_n) * law.inverse_sum;
  ConeReaction<Wide> point;
  point.x_n = select(sticks, u_n, select(slides, edge, Wide(0)));
  point.across = select(sticks, law.inverse_tangential, select(slides, edge * inverse_length, Wide(0)));
  point.normal = select(sticks, law.inverse_normal, select(slides, law.inverse_sum, Wide(0)));
  point.slide = select(slides, law.inverse_sum, Wide(0));
  point.bend = select(slides, law.inverse_sum - point.across, Wide(0));
  point.inverse_length = inverse_length;
  return point;
}

}  // namespace stiction::inline STICTION_ISA
