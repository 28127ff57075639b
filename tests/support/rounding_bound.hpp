#pragma once

#include <cmath>
#include <limits>
#include <vector>

#include "stiction/batch.hpp"

namespace stiction::test {

/// How far two evaluations in double of one environment's residual (docs/math/residual.md) can be apart, absolute.
///
/// Let u be the unit roundoff. A row's w = b + R lambda + A lambda is a sum of k + 2 terms. Whatever its order, fused
/// or not, it errs by at most (k + 3) u S with S = abs(b) + (R + abs(A)) abs(lambda). (Higham, Accuracy and Stability
/// of Numerical Algorithms, 2nd ed., 3.1.) A friction cone of m rows takes y = mu w from it and, under the Coulomb
/// law, adds norm(y_t) to the normal. The error of y is at most 1 + m times its rows' errors. The natural map a (x -
/// P(x - y / a)) takes that over once, projections being nonexpansive. It rounds a x and y itself, with a sum of m
/// squares and some six operations: (m + 8) u (a norm(x) + norm(y)). Two evaluations err twice that.
inline double residual_rounding(const ContactBatchView<double>& batch, Offset env, const std::vector<double>& lambda) {
  constexpr double kRoundoff = 0.5 * std::numeric_limits<double>::epsilon();
  const Offset first = batch.env_row_offsets[env];
  double largest = 0.0;
  for (Offset c = batch.env_cone_offsets[env]; c < batch.env_cone_offsets[env + 1]; ++c) {
    const double m = static_cast<double>(batch.cone_row_offsets[c + 1] - batch.cone_row_offsets[c]);
    double trace = 0.0, errors = 0.0, motions = 0.0, reactions = 0.0;
    for (Offset row = batch.cone_row_offsets[c]; row < batch.cone_row_offsets[c + 1]; ++row) {
      const double reaction = std::abs(lambda[static_cast<std::size_t>(row - first)]);
      double terms = std::abs(batch.b[row]) + batch.R[row] * reaction;
      trace += batch.R[row];
      for (Offset k = batch.row_offsets[row]; k < batch.row_offsets[row + 1]; ++k) {
        terms += std::abs(batch.A[k] * lambda[static_cast<std::size_t>(batch.column[k])]);
        if (batch.column[k] == row - first) trace += batch.A[k];
      }
      const bool slides = batch.cone_kind[c] == ConeKind::friction && row > batch.cone_row_offsets[c];
      const double mu = slides && batch.mu[row] > 0 ? batch.mu[row] : 1.0;
      const auto entries = static_cast<double>(batch.row_offsets[row + 1] - batch.row_offsets[row]);
      errors += mu * (entries + 3) * kRoundoff * terms;
      motions += mu * terms;  // no smaller than mu abs(w)
      reactions += reaction / mu;
    }
    const double own = (m + 8) * kRoundoff * (trace / m * reactions + motions);
    const double both = 2 * ((1 + m) * errors + own);
    if (both > largest) largest = both;
  }
  return largest;
}

}  // namespace stiction::test
