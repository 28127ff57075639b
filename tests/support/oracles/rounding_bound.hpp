#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "stiction/batch.hpp"

namespace stiction::test {

/// Diagonal of A + R and motion (A + R) lambda + b of one environment's row, with the sizes of their terms.
struct RowSizes {
  double diagonal = 0, motion = 0, terms = 0, entries = 0;
};
inline RowSizes row_sizes(const ContactBatchView<double>& batch, Offset first, Offset row,
                          const std::vector<double>& lambda) {
  const double reaction = lambda[static_cast<std::size_t>(row - first)];
  RowSizes of{batch.R[row], batch.b[row] + batch.R[row] * reaction,
              std::abs(batch.b[row]) + batch.R[row] * std::abs(reaction), 0};
  for (Offset k = batch.row_offsets[row]; k < batch.row_offsets[row + 1]; ++k) {
    const double term = batch.A[k] * lambda[static_cast<std::size_t>(batch.column[k])];
    of.motion += term;
    of.terms += std::abs(term);
    of.entries += 1;
    if (batch.column[k] == row - first) of.diagonal += batch.A[k];
  }
  return of;
}

/// The unit of a row's motion over that of its cone's normal row, sqrt(d_n / d_k).
inline double axis_unit(double d_n, double d_k) {
  return d_n > 0 && d_k > 0 ? std::sqrt(d_n / d_k) : 1.0;
}

/// Distance of two evaluations in double of one environment's largest error (docs/math/residual.md), absolute.
///
/// Let u be the unit roundoff. A row's w = b + R lambda + A lambda is a sum of k + 2 terms. Whatever its order, fused
/// or not, it errs by at most (k + 3) u S with S = abs(b) + (R + abs(A)) abs(lambda). (Higham, Accuracy and Stability
/// of Numerical Algorithms, 2nd ed., 3.1.) The distance from a member of the law's graph takes such an error over once.
/// It rounds x and y itself, in sums of 2 m squares and some twenty operations. For a sliding contact, the direction
/// of its motion turns by that error over its speed. The reaction's distance changes by as much of its size. A speed
/// below that is no more than the distance from sticking. Two evaluations err twice all that.
inline double residual_rounding(const ContactBatchView<double>& batch, Offset env, const std::vector<double>& lambda) {
  constexpr double kRoundoff = 0.5 * std::numeric_limits<double>::epsilon();
  const Offset first = batch.env_row_offsets[env];
  double largest = 0.0;
  for (Offset c = batch.env_cone_offsets[env]; c < batch.env_cone_offsets[env + 1]; ++c) {
    const double m = static_cast<double>(batch.cone_row_offsets[c + 1] - batch.cone_row_offsets[c]);
    double errors = 0.0, motions = 0.0, reactions = 0.0, slides = 0.0, d_n = 0.0;
    for (Offset row = batch.cone_row_offsets[c]; row < batch.cone_row_offsets[c + 1]; ++row) {
      const RowSizes of = row_sizes(batch, first, row, lambda);
      const bool is_axis = batch.cone_kind[c] == ConeKind::friction && row > batch.cone_row_offsets[c];
      if (!is_axis) d_n = of.diagonal;
      const double unit = is_axis ? axis_unit(d_n, of.diagonal) : 1.0;
      const double mu = is_axis && batch.mu[row] > 0 ? batch.mu[row] / unit : 1.0;
      errors += std::max(unit, mu * unit) * (of.entries + 3) * kRoundoff * of.terms;
      motions += std::max(unit, mu * unit) * of.terms;
      reactions += unit * of.diagonal * std::abs(lambda[static_cast<std::size_t>(row - first)]) / std::min(mu, 1.0);
      if (is_axis) slides += std::abs(unit * of.motion);
    }
    const double own = (2 * m + 24) * kRoundoff * (reactions + motions);
    const double turn = slides > 0 ? std::min(slides, (1 + m) * reactions * errors / slides) : 0.0;
    largest = std::max(largest, 2 * ((1 + m) * errors + own + turn));
  }
  return largest;
}

}  // namespace stiction::test
