#pragma once

#include "core/base/real.hpp"

/// Euclidean projections onto the cones, in coordinates in which every friction cone is the circular unit cone x_n >=
/// norm(x_t) (docs/math/cones.md). It is deliberately not the Euclidean projection in the original coordinates. Both
/// give valid complementarity functions, and this one has a closed form for any mu per axis.
namespace stiction::inline STICTION_ISA {

template <class Real>
STICTION_HD Real project_half_line(Real z) {
  return select(z > Real(0), z, Real(0));
}

/// norm(z_1 .. z_{M-1}), summed from the left.
template <int M, class Real>
STICTION_HD Real tangential_norm(const Real (&z)[M]) {
  Real sum = z[1] * z[1];
  for (int k = 2; k < M; ++k) sum = fma_(z[k], z[k], sum);
  return sqrt_(sum);
}

/// z's tangential part onto the disk of the given radius >= 0; z[0] is not read.
template <int M, class Real>
STICTION_HD void project_disk(Real (&z)[M], Real radius) {
  const Real length = tangential_norm<M>(z);
  const auto inside = length <= radius;
  const Real factor = select(inside, Real(1), div_(radius, length));
  for (int k = 1; k < M; ++k) z[k] = z[k] * factor;
}

/// z's tangential part onto the box [-radius, radius] of each axis, radius >= 0; z[0] is not read.
template <int M, class Real>
STICTION_HD void project_box(Real (&z)[M], Real radius) {
  for (int k = 1; k < M; ++k) z[k] = clamp_(z[k], Real(0) - radius, radius);
}

/// z onto the unit second-order cone, in the metric diag(1 - share, share, share, ...): 1/2 is Euclid's. The polar
/// cone is tested as well as the cone itself: at mu = 0 membership alone would leave (-z, 0) where it is.
template <int M, class Real>
STICTION_HD void project_second_order_cone(Real (&z)[M], Real share = Real(0.5)) {
  const Real length = tangential_norm<M>(z);
  const auto inside = length <= z[0];
  const Real pressed = (Real(1) - share) * z[0];
  const Real middle = fma_(share, length, pressed);
  // If lengths overflow, the sum is NaN, and the comparison is right.
  const auto polar = or_(share * length <= Real(0) - pressed, middle <= Real(0));
  const Real outside_factor = select(polar, Real(0), div_(middle, length));
  const Real factor = select(inside, Real(1), outside_factor);
  z[0] = select(inside, z[0], select(polar, Real(0), middle));
  for (int k = 1; k < M; ++k) z[k] = z[k] * factor;
}

}  // namespace stiction::inline STICTION_ISA
