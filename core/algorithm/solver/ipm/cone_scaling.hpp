#pragma once

#include "core/base/real.hpp"

/// The second-order cone's share of an interior point's iteration (docs/math/ipm.md): Nesterov and Todd's scaling, in a
/// frame in which it is diagonal.
namespace stiction::inline STICTION_ISA {

/// x_0 z_0 + sign x_t . z_t as if in twice the precision (Ogita, Rump, Oishi 2005, algorithm 5.3): near the boundary of
/// the cone the terms all but cancel.
template <int M>
STICTION_HD double careful_dot(const double (&x)[M], const double (&z)[M], double sign) {
  double sum = x[0] * z[0];
  double rest = fma_(x[0], z[0], 0.0 - sum);
  for (int k = 1; k < M; ++k) {
    const double factor = sign * z[k];
    const double product = x[k] * factor;
    const double lost_product = fma_(x[k], factor, 0.0 - product);
    const double next = sum + product;
    const double added = next - sum;
    const double lost_sum = (sum - (next - added)) + (product - added);
    rest = rest + (lost_product + lost_sum);
    sum = next;
  }
  return sum + rest;
}

/// x_0^2 - |x_t|^2 of a point inside the cone, kept positive: rounding may put a point on the boundary.
template <int M>
STICTION_HD double cone_determinant(const double (&x)[M]) {
  constexpr double kThinnest = 0x1p-104;
  return max_(careful_dot<M>(x, x, -1.0), x[0] * x[0] * kThinnest);
}

/// The scaling W of a primal-dual pair, W z = W^-1 x = lambda, on rotated coordinates. A reflection turns its axis
/// into the first tangent, and then W^-1 has the eigenvectors (1, 1, 0 ..), (1, -1, 0 ..) and the other tangents.
template <int M>
struct ConeScaling {
  double inverse_eigenvalues[M];  ///< eigenvalues of W^-1, in that order
  double householder[M];          ///< normal of the reflection, from index 1 on
  double lambda[M];               ///< the scaled point, rotated

  /// v reflected; its own inverse.
  STICTION_HD void rotate(double (&v)[M]) const {
    if (!(abs_(householder[1]) > 0.0)) return;
    double along = householder[1] * v[1];
    for (int k = 2; k < M; ++k) along = fma_(householder[k], v[k], along);
    const double part = div_(0.0 - along, abs_(householder[1]));
    for (int k = 1; k < M; ++k) v[k] = fma_(part, householder[k], v[k]);
  }
  /// Between rotated coordinates and sums and differences of the first two.
  static STICTION_HD void to_sum_difference(double (&v)[M]) {
    const double sum = v[0] + v[1];
    v[1] = v[0] - v[1];
    v[0] = sum;
  }
  /// Q v: from the frame's coefficients to the cone's rows.
  STICTION_HD void from_frame(double (&v)[M]) const {
    to_sum_difference(v);
    rotate(v);
  }
  /// Q' v: forces on the cone's rows as forces along the frame.
  STICTION_HD void to_frame(double (&v)[M]) const {
    rotate(v);
    to_sum_difference(v);
  }
  /// W^-2 in the frame. Its first two vectors have length sqrt 2.
  [[nodiscard]] STICTION_HD double diagonal(int k) const {
    return (k < 2 ? 2.0 : 1.0) * (inverse_eigenvalues[k] * inverse_eigenvalues[k]);
  }
};

/// The scaling of x and z, both inside the cone (Vandenberghe 2010, section 4.2).
template <int M>
STICTION_HD_OUTLINE ConeScaling<M> scale_cone(const double (&x)[M], const double (&z)[M]) {
  const double size_x = sqrt_(cone_determinant<M>(x));
  const double size_z = sqrt_(cone_determinant<M>(z));
  const double cosine = div_(careful_dot<M>(x, z, 1.0), size_x * size_z);
  const double gamma = sqrt_(fma_(0.5, max_(cosine - 1.0, 0.0), 1.0));
  const double x_0 = div_(x[0], size_x);
  const double z_0 = div_(z[0], size_z);
  const double inverse = div_(0.5, gamma);
  double axis[M];
  double length = 0.0;
  ConeScaling<M> scaling;
  const double total = x_0 + z_0 + 2.0 * gamma;
  const double size = sqrt_(size_x * size_z);
  scaling.lambda[0] = size * gamma;
  axis[0] = 0.0;
  for (int k = 1; k < M; ++k) {
    const double x_k = div_(x[k], size_x);
    const double z_k = div_(z[k], size_z);
    axis[k] = (x_k - z_k) * inverse;
    length = fma_(axis[k], axis[k], length);
    scaling.lambda[k] = size * div_(fma_(gamma + z_0, x_k, (gamma + x_0) * z_k), total);
  }
  length = sqrt_(length);
  const double eta = sqrt_(div_(size_x, size_z));
  const double large = sqrt_(fma_(length, length, 1.0)) + length;
  const bool reflected_up = axis[1] < 0.0;
  for (int k = 0; k < M; ++k) scaling.householder[k] = length > 0.0 && k > 0 ? div_(axis[k], length) : 0.0;
  if (length > 0.0) scaling.householder[1] = scaling.householder[1] + (reflected_up ? -1.0 : 1.0);
  // The reflection turns the axis into minus the sign of its first component.
  const double along = div_(1.0, eta * large);
  const double against = div_(large, eta);
  scaling.inverse_eigenvalues[0] = reflected_up ? along : against;
  scaling.inverse_eigenvalues[1] = reflected_up ? against : along;
  for (int k = 2; k < M; ++k) scaling.inverse_eigenvalues[k] = div_(1.0, eta);
  scaling.rotate(scaling.lambda);
  return scaling;
}

/// lambda \ d, the u with lambda o u = d in the cone's Jordan algebra; d becomes u.
template <int M>
STICTION_HD void jordan_divide(const double (&lambda)[M], double (&d)[M]) {
  const double first = div_(careful_dot<M>(lambda, d, -1.0), cone_determinant<M>(lambda));
  for (int k = 1; k < M; ++k) d[k] = div_(fma_(0.0 - first, lambda[k], d[k]), lambda[0]);
  d[0] = first;
}

/// d - u o v.
template <int M>
STICTION_HD void subtract_jordan_product(double (&d)[M], const double (&u)[M], const double (&v)[M]) {
  for (int k = 0; k < M; ++k) d[0] = fma_(0.0 - u[k], v[k], d[0]);
  for (int k = 1; k < M; ++k) d[k] = d[k] - fma_(u[0], v[k], v[0] * u[k]);
}

/// The reciprocal of the largest t for which lambda + t d is in the cone; zero where it always is (Vandenberghe 2010,
/// section 8.3).
template <int M>
STICTION_HD_OUTLINE double reciprocal_step(const double (&lambda)[M], const double (&d)[M]) {
  const double size = sqrt_(cone_determinant<M>(lambda));
  const double first = div_(careful_dot<M>(lambda, d, -1.0), size);
  const double factor = div_(first + d[0], lambda[0] + size);
  double sum = 0.0;
  for (int k = 1; k < M; ++k) {
    const double part = fma_(0.0 - factor, lambda[k], d[k]);
    sum = fma_(part, part, sum);
  }
  return max_(div_(sqrt_(sum) - first, size), 0.0);
}

}  // namespace stiction::inline STICTION_ISA
