#pragma once

#include "core/base/real.hpp"

/// The friction cone of one contact in the contact's own units, |x_t| <= mu x_n, and Euclidean distances in them
/// (docs/math/body_newton.md, (2) and (3)).
namespace stiction::inline STICTION_ISA {

/// Projection of a point and, in rows n, t1, t2, an element of its generalised derivative: symmetric, eigenvalues in
/// [0, 1].
struct ConePoint {
  double x[3];
  double P[3][3];
};

STICTION_HD ConePoint project_friction_cone(const double (&z)[3], double mu) {
  ConePoint point;
  const double length = sqrt_(fma_(z[2], z[2], z[1] * z[1]));
  const bool is_inside = length <= mu * z[0];
  const bool is_outside = !is_inside && mu * length > 0.0 - z[0];  // else in the polar cone
  for (int i = 0; i < 3; ++i) {
    point.x[i] = is_inside ? z[i] : 0.0;
    for (int j = 0; j < 3; ++j) point.P[i][j] = is_inside && i == j ? 1.0 : 0.0;
  }
  if (!is_outside) return point;
  const double share = div_(1.0, fma_(mu, mu, 1.0));
  const double normal = share * fma_(mu, length, z[0]);
  const double radius = mu * normal;
  const double s[3] = {0.0, length > 0.0 ? div_(z[1], length) : 0.0, length > 0.0 ? div_(z[2], length) : 0.0};
  const double bend = length > 0.0 ? div_(radius, length) : 0.0;
  point.x[0] = normal;
  point.P[0][0] = share;
  for (int i = 1; i < 3; ++i) {
    point.x[i] = radius * s[i];
    point.P[0][i] = point.P[i][0] = (share * mu) * s[i];
    for (int j = 1; j < 3; ++j) {
      const double along = s[i] * s[j];
      point.P[i][j] = fma_((share * mu) * mu, along, bend * ((i == j ? 1.0 : 0.0) - along));
    }
  }
  return point;
}

}  // namespace stiction::inline STICTION_ISA
