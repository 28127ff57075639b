#pragma once

#include "core/algorithm/linear/dense/dense_factor.hpp"
#include "core/team/reduce.hpp"

/// A general square matrix of doubles, factored and solved by a team. As in dense_factor.hpp every entry is updated by
/// one lane in an order given by the columns alone. The pivot is the largest magnitude of its column and, among
/// equals, the first, which no number of lanes can change.
namespace stiction::inline STICTION_ISA {

/// Factors P K = L U by partial pivoting (Golub and Van Loan 2013, section 3.4), in place. pivots[j] is the row that
/// was exchanged with row j. A column without a pivot above `floor` is a direction that K does not see. Its pivot
/// becomes a number so large that the solution has no part along it. Returns how many there were, on every lane.
template <Team TeamT>
STICTION_HD_OUTLINE Index factor_lu(TeamT& team, const DenseMatrix& K, double* pivots, double floor = 0.0) {
  const Index n = K.n;
  Index replaced = 0;
  for (Index j = 0; j < n; ++j) {
    const double largest = max_over<double>(team, n - j, [&](Index k) { return abs_(K(j + k, j)); });
    // The first row that has it: the one furthest from the end.
    const double from_end = max_over<double>(
        team, n - j, [&](Index k) { return abs_(K(j + k, j)) == largest ? static_cast<double>(n - j - k) : 0.0; });
    const Index row = from_end > 0.0 ? n - static_cast<Index>(from_end) : j;
    if (row != j) {
      for_each(team, n, [&](Index c) {
        const double kept = K(j, c);
        K(j, c) = K(row, c);
        K(row, c) = kept;
      });
    }
    const bool is_sound = largest > floor && finite_(largest);
    if (!is_sound) ++replaced;
    single(team, [&] {
      pivots[j] = static_cast<double>(row);
      if (!is_sound) K(j, j) = kReplacedPivot;
    });
    const double pivot = K(j, j);
    const auto update = [&](Index i, Index k) { K(i, k) = fma_(0.0 - K(i, j), K(j, k), K(i, k)); };
    if (team.size() == 1) {
      for (Index i = j + 1; i < n; ++i) K(i, j) = div_(K(i, j), pivot);
      for (Index k = j + 1; k < n; ++k)
        for (Index i = j + 1; i < n; ++i) update(i, k);
    } else {
      for_each(team, n - j - 1, [&](Index r) {
        const Index i = j + 1 + r;
        K(i, j) = div_(K(i, j), pivot);
        for (Index k = j + 1; k < n; ++k) update(i, k);
      });
    }
  }
  return replaced;
}

/// v = K^-1 v by the factor.
template <Team TeamT>
STICTION_HD_OUTLINE void solve_lu(TeamT& team, const DenseMatrix& K, const double* pivots, double* v) {
  const Index n = K.n;
  single(team, [&] {
    for (Index j = 0; j < n; ++j) {
      const auto row = static_cast<Index>(pivots[j]);
      const double kept = v[j];
      v[j] = v[row];
      v[row] = kept;
    }
  });
  for (Index j = 0; j + 1 < n; ++j) {
    const double known = v[j];
    for_each(team, n - j - 1, [&](Index k) {
      const Index i = j + 1 + k;
      v[i] = fma_(0.0 - K(i, j), known, v[i]);
    });
  }
  for (Index j = n - 1; j >= 0; --j) {
    single(team, [&] { v[j] = div_(v[j], K(j, j)); });
    const double known = v[j];
    for_each(team, j, [&](Index i) { v[i] = fma_(0.0 - K(i, j), known, v[i]); });
  }
}

}  // namespace stiction::inline STICTION_ISA
