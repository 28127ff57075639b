#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "stiction/batch.hpp"
#include "tests/support/oracles/rounding_bound.hpp"

namespace stiction::test {

/// Bound of the distance between the motions of two approximate solutions of one convex system.
///
/// Let A + R be symmetric positive semidefinite, and let (lambda, w) and (lambda', w') have errors e and e'
/// (docs/math/residual.md). Pairs that obey the law are no further away: a row's reaction by p_k, its motion by q_k.
/// Pairs that obey a convex law are monotone. Let d = lambda - lambda' and g = w - w'. Hence (g - q)'(d - p) <= 0, and
/// norm(g)^2 <= L g'd, L a bound on the largest eigenvalue. norm(g) is at most the larger root of
///
///     g^2 = L (g norm(p) + norm(q) norm(d) + norm(p) norm(q)).
///
/// A cone's error bounds the norm of unit_k d_k p_k and of unit_k q_k. Errors are themselves rounded: that rounding
/// joins them. No constant is fitted; a solution that is wrong by more than its residual explains does not pass.
struct MotionBound {
  double difference;  ///< norm(w - w')
  double bound;
};

/// Environment `env` of a batch; residuals are absolute, the largest over cones, as verify() gives them.
inline MotionBound motion_bound(const ContactBatchView<double>& batch, Offset env, const std::vector<double>& lambda,
                                double residual, const std::vector<double>& other, double other_residual) {
  const Offset first = batch.env_row_offsets[env];
  const double s =
      residual + other_residual + residual_rounding(batch, env, lambda) + residual_rounding(batch, env, other);
  std::vector<double> change(lambda.size());
  for (std::size_t i = 0; i < lambda.size(); ++i) change[i] = lambda[i] - other[i];
  double g2 = 0, d2 = 0, p2 = 0, q2 = 0, largest_row = 0;
  for (Offset c = batch.env_cone_offsets[env]; c < batch.env_cone_offsets[env + 1]; ++c) {
    double least_press = 0, least_unit = 0, d_n = 0;
    for (Offset row = batch.cone_row_offsets[c]; row < batch.cone_row_offsets[c + 1]; ++row) {
      const RowSizes of = row_sizes(batch, first, row, change);
      const bool is_axis = batch.cone_kind[c] == ConeKind::friction && row > batch.cone_row_offsets[c];
      if (!is_axis) d_n = of.diagonal;
      double row_sum = batch.R[row];
      for (Offset k = batch.row_offsets[row]; k < batch.row_offsets[row + 1]; ++k) row_sum += std::abs(batch.A[k]);
      largest_row = std::max(largest_row, row_sum);
      // An axis without friction is no part of the law.
      if (is_axis && !(batch.mu[row] > 0)) continue;
      const double unit = is_axis ? axis_unit(d_n, of.diagonal) : 1.0;
      const double g = of.motion - batch.b[row], d = change[static_cast<std::size_t>(row - first)];
      g2 += g * g;
      d2 += d * d;
      const double press = unit * of.diagonal;
      least_press = least_press > 0 ? std::min(press, least_press) : press;
      least_unit = least_unit > 0 ? std::min(unit, least_unit) : unit;
    }
    p2 += s * s / (least_press * least_press);
    q2 += s * s / (least_unit * least_unit);
  }
  const double p = std::sqrt(p2), q = std::sqrt(q2), half = 0.5 * largest_row * p;
  return {std::sqrt(g2), half + std::sqrt(half * half + largest_row * q * (std::sqrt(d2) + p))};
}

}  // namespace stiction::test
