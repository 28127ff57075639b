#pragma once

#include "core/algorithm/problem/cone_projection.hpp"
#include "core/algorithm/problem/cone_shape.hpp"

namespace stiction::inline STICTION_ISA {

/// An element of the generalised derivative of a cone's projection at z (docs/math/newton.md, (9)). The cone is the
/// circular unit cone, the half line, the interval [lo, hi] or the line.
template <class Shape, int M>
STICTION_HD_OUTLINE void projection_derivative(Shape, const double (&z)[M], double lo, double hi, double (&P)[M][M]) {
  double inside = 1.0;
  if constexpr (Shape::kKind == ConeKind::unilateral) inside = z[0] > 0.0 ? 1.0 : 0.0;
  if constexpr (Shape::kKind == ConeKind::box) inside = z[0] > lo && z[0] < hi ? 1.0 : 0.0;
  if constexpr (Shape::kKind == ConeKind::friction) {
    const double length = tangential_norm<M>(z);
    inside = length <= z[0] ? 1.0 : 0.0;
    if (length > abs_(z[0])) {
      double s[M];
      for (int k = 1; k < M; ++k) s[k] = div_(z[k], length);
      const double share = div_(z[0], length);
      P[0][0] = 0.5;
      for (int i = 1; i < M; ++i) {
        P[0][i] = P[i][0] = 0.5 * s[i];
        for (int j = 1; j < M; ++j) {
          const double turned = (i == j ? 1.0 + share : 0.0) - (share * s[i]) * s[j];
          P[i][j] = 0.5 * turned;
        }
      }
      return;
    }
  }
  for (int i = 0; i < M; ++i)
    for (int j = 0; j < M; ++j) P[i][j] = i == j ? inside : 0.0;
}

}  // namespace stiction::inline STICTION_ISA
