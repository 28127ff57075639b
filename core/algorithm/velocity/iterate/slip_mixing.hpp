#pragma once

#include "core/base/real.hpp"
#include "stiction/types.hpp"

namespace stiction::inline STICTION_ISA {

/// Fixed-point iteration s <- G(s) on de Saxce's terms of one environment's cones, with Anderson's mixing of the last
/// three. The next iterate is the combination of the G(s) whose differences G(s) - s, combined so, are least.
///
/// D. G. Anderson, Iterative procedures for nonlinear integral equations, J. ACM 12 (1965); H. F. Walker, P. Ni,
/// Anderson acceleration for fixed-point iterations, SIAM J. Numer. Anal. 49 (2011).
struct SlipMixing {
  /// Weights beyond this are not trusted.
  static constexpr double kMostWeight = 10.0;

  double* data;  ///< the environment's numbers: kSlips arrays of `cones`, `stride` apart
  Index cones;
  Index stride;
  Index known;  ///< evaluations that are kept, 0 to 2, the last one not counted

  /// G(s) and G(s) - s of an evaluation: the last one for age 0.
  [[nodiscard]] STICTION_HD double& image(Index age, Index cone) const {
    return data[(static_cast<Offset>(2 * age) * cones + cone) * stride];
  }
  [[nodiscard]] STICTION_HD double& change(Index age, Index cone) const {
    return data[(static_cast<Offset>(2 * age + 1) * cones + cone) * stride];
  }

  /// Older ones move back by one.
  STICTION_HD void age(Index cone) const {
    for (Index older = 2; older > 0; --older) {
      image(older, cone) = image(older - 1, cone);
      change(older, cone) = change(older - 1, cone);
    }
  }

  struct Weights {
    double last;
    double before;
  };
  /// Least squares for the differences from one evaluation to the next.
  [[nodiscard]] STICTION_HD Weights weights() const {
    if (known == 0) return {0.0, 0.0};
    double a = 0.0;
    double b = 0.0;
    double d = 0.0;
    double p = 0.0;
    double q = 0.0;
    for (Index c = 0; c < cones; ++c) {
      const double last = change(0, c) - change(1, c);
      const double before = known > 1 ? change(1, c) - change(2, c) : 0.0;
      a = fma_(last, last, a);
      b = fma_(last, before, b);
      d = fma_(before, before, d);
      p = fma_(last, change(0, c), p);
      q = fma_(before, change(0, c), q);
    }
    if (!(a > 0.0)) return {0.0, 0.0};
    const double determinant = fma_(a, d, 0.0 - b * b);
    const bool is_pair = determinant > 1e-8 * (a * d);
    const Weights found =
        is_pair ? Weights{div_(fma_(d, p, 0.0 - b * q), determinant), div_(fma_(a, q, 0.0 - b * p), determinant)}
                : Weights{div_(p, a), 0.0};
    const bool trusted = abs_(found.last) <= kMostWeight && abs_(found.before) <= kMostWeight;
    return trusted ? found : Weights{0.0, 0.0};
  }
  /// A cone's next term, which is not negative.
  [[nodiscard]] STICTION_HD double next(const Weights& weights, Index cone) const {
    double mixed = image(0, cone);
    if (known > 0) mixed = fma_(0.0 - weights.last, image(0, cone) - image(1, cone), mixed);
    if (known > 1) mixed = fma_(0.0 - weights.before, image(1, cone) - image(2, cone), mixed);
    return mixed > 0.0 ? mixed : 0.0;
  }
};

}  // namespace stiction::inline STICTION_ISA
