#pragma once

#include <cmath>
#include <vector>

#include "stiction/batch.hpp"
#include "tests/support/rounding_bound.hpp"

namespace stiction::test {

/// How far apart the motions of two approximate solutions of one convex system can be.
///
/// Let A + R be symmetric positive semidefinite. Let z and z' be reactions in circular coordinates with natural-map
/// residuals r and r'. (r = a (z - p), p = P(z - y / a), a per cone.) The projection's inequality at p' and p, added
/// up, gives (y - y')'(p - p') <= (r - r')'(p - p'). With p = z - r / a and g = y - y', d = z - z', s = norm(r) +
/// norm(r'):
///
///     g'd <= s (norm(d) + s / a) + norm(g) s / a,     and  norm(g)^2 <= L g'd,
///
/// a the smallest weight and L a bound on the largest eigenvalue. So norm(g) is at most the larger root of
/// g^2 = L (s norm(d) + s^2 / a + g s / a). Residuals are themselves rounded: what that can be joins s. No constant is
/// fitted; a solution that is wrong by more than its residual explains does not pass.
struct MotionBound {
  double difference;  ///< norm(y - y')
  double bound;
};

/// Environment `env` of a batch; residuals are absolute, the largest over cones, as verify() gives them.
inline MotionBound motion_bound(const ContactBatchView<double>& batch, Offset env, const std::vector<double>& lambda,
                                double residual, const std::vector<double>& other, double other_residual) {
  const Offset first = batch.env_row_offsets[env];
  const auto n = static_cast<std::size_t>(batch.env_row_offsets[env + 1] - first);
  std::vector<double> mu(n, 1.0), diagonal(n, 0.0);
  double smallest_weight = 0.0;
  double cones = 0.0;
  for (Offset c = batch.env_cone_offsets[env]; c < batch.env_cone_offsets[env + 1]; ++c) {
    double trace = 0.0;
    for (Offset row = batch.cone_row_offsets[c]; row < batch.cone_row_offsets[c + 1]; ++row) {
      if (batch.cone_kind[c] == ConeKind::friction && row > batch.cone_row_offsets[c])
        mu[static_cast<std::size_t>(row - first)] = batch.mu[row];
      trace += batch.R[row];
      for (Offset k = batch.row_offsets[row]; k < batch.row_offsets[row + 1]; ++k)
        if (batch.column[k] == row - first) trace += batch.A[k];
    }
    const double weight = trace / static_cast<double>(batch.cone_row_offsets[c + 1] - batch.cone_row_offsets[c]);
    if (cones == 0.0 || weight < smallest_weight) smallest_weight = weight;
    cones += 1.0;
  }
  double g2 = 0.0, d2 = 0.0, largest_row = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    const Offset row = first + static_cast<Offset>(i);
    double g = batch.R[row] * (lambda[i] - other[i]);
    double row_sum = mu[i] * mu[i] * batch.R[row];
    for (Offset k = batch.row_offsets[row]; k < batch.row_offsets[row + 1]; ++k) {
      const auto j = static_cast<std::size_t>(batch.column[k]);
      g += batch.A[k] * (lambda[j] - other[j]);
      row_sum += std::abs(mu[i] * batch.A[k] * mu[j]);
    }
    g2 += mu[i] * g * mu[i] * g;
    const double d = mu[i] > 0 ? (lambda[i] - other[i]) / mu[i] : 0.0;
    d2 += d * d;
    if (row_sum > largest_row) largest_row = row_sum;
  }
  const double rounding = residual_rounding(batch, env, lambda) + residual_rounding(batch, env, other);
  const double s = (residual + other_residual + rounding) * std::sqrt(cones);
  const double half = 0.5 * largest_row * s / smallest_weight;
  const double root = half + std::sqrt(half * half + largest_row * (s * std::sqrt(d2) + s * s / smallest_weight));
  return {std::sqrt(g2), root};
}

}  // namespace stiction::test
