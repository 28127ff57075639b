#pragma once

#include "core/algorithm/problem/cone_projection.hpp"
#include "core/algorithm/problem/cone_shape.hpp"

/// The reaction of one compliant cone to a given motion u, and how it changes with u (docs/math/newton.md, (2)-(6)).
namespace stiction::inline STICTION_ISA {

/// Where on its law a cone is. Within kSeparating and kSticking the reaction is affine in u; while a cone slides it is
/// not.
enum ConeZone : int {
  kSeparating = 0,  ///< at the cone's apex, or at a box's bound: the reaction does not change with u
  kSticking,        ///< inside: x = -u / R
  kSliding,         ///< on the boundary of a friction cone
};

/// x(u) = argmin of x'Rx / 2 + u'x over the cone, with what its derivative is made of.
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
    // Columns of T: (1, s), then what the reflection that maps s to an axis makes of the other axes.
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
