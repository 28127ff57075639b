#pragma once

#include "core/algorithm/problem/cone_projection.hpp"
#include "core/algorithm/problem/cone_shape.hpp"

/// Reactions of compliant cones as functions of the motion of their rows, and their slopes. The reaction is the point
/// of the cone nearest to -z / R in the metric R. It is minus the gradient of a convex potential of z
/// (docs/math/velocity_newton.md, "Potentials of cones"). All of Newton's methods are built on it.
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

/// A point projected onto the friction cone of a contact in the contact's own units, |x_t| <= mu x_n, by Euclidean
/// distance. In rows n, t1, t2 an element of the projection's generalised derivative: symmetric, eigenvalues in [0, 1].
struct ConePoint {
  double x[3];
  double P[3][3];
  bool is_inside;  ///< no further from its axis than it may be
};
/// It is the reaction to -z with compliances 1 and, in the coordinates of the unit cone, mu^2
/// (docs/math/body_newton.md, (2) and (3)).
STICTION_HD ConePoint project_friction_cone(const double (&z)[3], double mu) {
  const double square = mu * mu, length = sqrt_(fma_(z[2], z[2], z[1] * z[1]));
  const ConeLaw<double> law{1.0, square > 0.0 ? div_(1.0, square) : 0.0, div_(1.0, 1.0 + square)};
  const ConeReaction<double> answer = cone_reaction(law, 0.0 - z[0], mu * length);
  const double inverse = length > 0.0 ? div_(1.0, length) : 0.0;
  ConePoint point;
  point.is_inside = answer.normal == 1.0 && answer.slide == 0.0;
  const double across = point.is_inside && mu > 0.0 ? 1.0 : square * answer.across;
  point.x[0] = answer.x_n;
  point.P[0][0] = answer.normal;
  for (int i = 1; i < 3; ++i) {
    const double s = z[i] * inverse;
    point.x[i] = across * z[i];
    point.P[0][i] = point.P[i][0] = (mu * answer.slide) * s;
    for (int j = 1; j < 3; ++j) point.P[i][j] = fma_((square * answer.bend) * s, z[j] * inverse, i == j ? across : 0.0);
  }
  return point;
}

// With a compliance for each axis (docs/math/newton.md, (2)-(6)).

/// Zone of the law that a cone is in. Within kSeparating and kSticking the reaction is affine in u; while a cone
/// slides it is not.
enum ConeZone : int {
  kSeparating = 0,  ///< at the cone's apex, or at a box's bound: the reaction does not change with u
  kSticking,        ///< inside: x = -u / R
  kSliding,         ///< on the boundary of a friction cone
};

/// x(u) = argmin of x'Rx / 2 + u'x over the cone, with the parts of its derivative.
template <int M>
struct CompliantPoint {
  double x[M];
  double u[M];  ///< the motion it answers
  int contact_state;
  double normal;     ///< sliding: x_n = norm(x_t)
  double stiffness;  ///< sliding: eta / normal, eta being the multiplier of the boundary
  double s[M];       ///< sliding: x_t / x_n, a unit vector; s[0] is not used
};

/// Steps of Newton's method on the sliding cone's scalar equation. One does for a single compliance; with 6 and
/// compliances six orders apart the tests see the error.
inline constexpr int kSlidingSteps = 12;

/// The sliding zone of a friction cone: x = tau (1, s) with s_i = -u_i / ((R_i + R_n) tau + u_n), norm(s) = 1. The
/// inverse of norm(s) is concave and increasing in tau, so Newton's method on it never passes the root. It is a
/// straight line if all R_i are equal.
template <int M>
STICTION_HD_OUTLINE void slide(CompliantPoint<M>& point, const double (&u)[M], const double (&R)[M]) {
  double tau = max_(div_(0.0 - u[0], R[0]), 0.0);
  for (int k = 1; k < M; ++k) tau = max_(div_(abs_(u[k]) - u[0], R[k] + R[0]), tau);
  double eta = 0.0;
  double squares = 1.0;
  for (int step = 0;; ++step) {
    eta = max_(fma_(R[0], tau, u[0]), 0.0);
    squares = 0.0;
    double slope = 0.0;
    for (int k = 1; k < M; ++k) {
      const double width = max_(fma_(R[k], tau, eta), 0x1p-900);
      point.s[k] = div_(0.0 - u[k], width);
      const double square = point.s[k] * point.s[k];
      squares = squares + square;
      slope = fma_(div_(square, width), R[k] + R[0], slope);
    }
    if (step == kSlidingSteps || !(slope > 0.0)) break;
    const double next = tau + max_(div_(squares * (sqrt_(squares) - 1.0), slope), 0.0);
    // Further steps would compute the same again.
    if (next == tau) break;
    tau = next;
  }
  const double inverse = div_(1.0, sqrt_(squares));
  point.contact_state = kSliding;
  point.normal = tau;
  point.stiffness = tau > eta * 0x1p-400 ? div_(eta, tau) : 0x1p+400;
  point.x[0] = tau;
  for (int k = 1; k < M; ++k) {
    point.s[k] = point.s[k] * inverse;
    point.x[k] = tau * point.s[k];
  }
}

/// x(u). R > 0; a friction axis without friction has u = 0 and any R > 0.
template <class Shape, int M>
STICTION_HD_OUTLINE CompliantPoint<M> compliant_point(Shape, const double (&u)[M], const double (&R)[M], double lo,
                                                      double hi) {
  CompliantPoint<M> point{};
  for (int k = 0; k < M; ++k) {
    point.x[k] = div_(0.0 - u[k], R[k]);
    point.u[k] = u[k];
  }
  point.contact_state = kSticking;
  if constexpr (Shape::kKind == ConeKind::unilateral) {
    if (!(point.x[0] > 0.0)) {
      point.x[0] = 0.0;
      point.contact_state = kSeparating;
    }
  } else if constexpr (Shape::kKind == ConeKind::box) {
    if (!(point.x[0] > lo && point.x[0] < hi)) {
      point.x[0] = clamp_(point.x[0], lo, hi);
      point.contact_state = kSeparating;
    }
  } else if constexpr (Shape::kKind == ConeKind::friction) {
    if (tangential_norm<M>(u) <= u[0]) {
      for (int k = 0; k < M; ++k) point.x[k] = 0.0;
      point.contact_state = kSeparating;
    } else if (!(tangential_norm<M>(point.x) <= point.x[0])) {
      slide(point, u, R);
    }
  }
  return point;
}

/// C with C C' = W = -dx/du, lower columns first; columns beyond the rank are zero. On the boundary dx stays in the
/// tangent space T of the cone, spanned by (1, s) and the w orthogonal to s. There W = T (T'HT)^-1 T' with H = R and
/// on the w also eta / tau, the curvature of the boundary. C = T L^-T with L L' = T'HT, positive definite.
template <class Shape, int M>
STICTION_HD_OUTLINE void compliance_factor(Shape, const CompliantPoint<M>& point, const double (&R)[M],
                                           double (&C)[M][M]) {
  for (int i = 0; i < M; ++i)
    for (int j = 0; j < M; ++j) C[i][j] = 0.0;
  if (point.contact_state == kSticking)
    for (int k = 0; k < M; ++k) C[k][k] = div_(1.0, sqrt_(R[k]));
  if constexpr (Shape::kKind == ConeKind::friction) {
    if (point.contact_state != kSliding) return;
    // Columns of T: (1, s), then the other axes under the reflection that maps s to an axis.
    double reflector[M];
    for (int k = 1; k < M; ++k) reflector[k] = point.s[k];
    reflector[1] = reflector[1] + (point.s[1] < 0.0 ? -1.0 : 1.0);
    const double twice = div_(1.0, abs_(reflector[1]));
    C[0][0] = 1.0;
    for (int k = 1; k < M; ++k) C[k][0] = point.s[k];
    for (int j = 1; j + 1 < M; ++j)
      for (int k = 1; k < M; ++k) C[k][j] = fma_(0.0 - twice * reflector[j + 1], reflector[k], k == j + 1 ? 1.0 : 0.0);
    double L[M][M];
    for (int i = 0; i + 1 < M; ++i)
      for (int j = 0; j <= i; ++j) {
        double sum = i == j && i > 0 ? point.stiffness : 0.0;
        for (int k = 0; k < M; ++k) sum = fma_(C[k][i] * R[k], C[k][j], sum);
        for (int k = 0; k < j; ++k) sum = fma_(0.0 - L[i][k], L[j][k], sum);
        L[i][j] = i == j ? sqrt_(max_(sum, 0x1p-900)) : div_(sum, L[j][j]);
      }
    for (int j = 0; j + 1 < M; ++j)
      for (int k = 0; k < M; ++k) {
        double sum = C[k][j];
        for (int i = 0; i < j; ++i) sum = fma_(0.0 - C[k][i], L[j][i], sum);
        C[k][j] = div_(sum, L[j][j]);
      }
  }
}

}  // namespace stiction::inline STICTION_ISA
