#pragma once

#include "core/base/real.hpp"

namespace stiction::inline STICTION_ISA {

/// The step D of a cone's natural map.
template <class System>
STICTION_HD double natural_step(const System& s, Index cone) {
  const auto inverse = static_cast<double>(s.inv_cone[cone]);
  return inverse > 0.0 ? inverse : 1.0;
}

/// One cone's part of the derivative of the proximal natural map, I - P' + P' D (S (A + R) + pull I). S adds the
/// derivative of de Saxce's term to the normal row (docs/math/newton.md, (8)).
template <int M>
struct NaturalSlope {
  double P[M][M];
  double turn[M];  ///< derivative of norm(y_t)
  double D;
  double prox_weight;

  /// The cone's rows of F' v from its rows of v and of (A + R) v.
  STICTION_HD void apply(const double (&v)[M], const double (&image)[M], double (&out)[M]) const {
    double motion[M];
    for (int k = 0; k < M; ++k) motion[k] = image[k];
    for (int k = 1; k < M; ++k) motion[0] = fma_(turn[k], motion[k], motion[0]);
    for (int k = 0; k < M; ++k) motion[k] = D * (motion[k] + prox_weight * v[k]);
    for (int i = 0; i < M; ++i) {
      out[i] = v[i];
      for (int k = 0; k < M; ++k) out[i] = fma_(P[i][k], motion[k] - v[k], out[i]);
    }
  }
};

}  // namespace stiction::inline STICTION_ISA
