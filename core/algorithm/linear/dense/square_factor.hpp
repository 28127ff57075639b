#pragma once

#include "core/base/strided.hpp"
#include "core/team/phases.hpp"

/// L D L' of a symmetric positive definite matrix in the solve's own precision, for lanes of a pack, each with its
/// matrix. dense_factor.hpp is for one environment, in double.
namespace stiction::inline STICTION_ISA {

/// n x n numbers, column by column.
template <class Real, int kStride>
struct SquareMatrix {
  Strided<Real, kStride> data;
  Index n;
  STICTION_HD Real& operator()(Index i, Index j) const { return data[i + n * j]; }
};

/// Columns that are factored together, so that each read of the columns before serves all of them.
inline constexpr Index kPanel = 4;

/// The sums over the columns before a panel: K(i, first + c) less those of K(i, k) L(first + c, k), of kCount rows.
template <Index kCount, class Real, int kStride>
STICTION_HD void reduce_rows(const SquareMatrix<Real, kStride>& K, Index row, Index first, Index width) {
  if (width == kPanel) {
    Real sum[kPanel][kCount];
    for (Index c = 0; c < kPanel; ++c)
      for (Index r = 0; r < kCount; ++r) sum[c][r] = K(row + r, first + c);
    for (Index k = 0; k < first; ++k) {
      Real value[kCount];
      for (Index r = 0; r < kCount; ++r) value[r] = K(row + r, k);
      for (Index c = 0; c < kPanel; ++c) {
        const Real factor = K(k, first + c);
        for (Index r = 0; r < kCount; ++r) sum[c][r] = fma_(Real(0) - value[r], factor, sum[c][r]);
      }
    }
    for (Index c = 0; c < kPanel; ++c)
      for (Index r = 0; r < kCount; ++r)
        if (row + r >= first + c) K(row + r, first + c) = sum[c][r];
  } else {
    for (Index c = 0; c < width; ++c)
      for (Index i = row; i < row + kCount; ++i) {
        if (i < first + c) continue;
        Real sum = K(i, first + c);
        for (Index k = 0; k < first; ++k) sum = fma_(Real(0) - K(i, k), K(k, first + c), sum);
        K(i, first + c) = sum;
      }
  }
}

/// Factors K, of which the lower triangle is read, by panels of columns from the left (Golub and Van Loan 2013,
/// sections 4.1.2 and 4.2.6). Every entry is one lane's sum in the order of the columns before, and is written twice.
/// Afterwards row i of L lies above the diagonal of column i, L D below it, and `inverse` holds 1 / D. A pivot that is
/// not above floor(j) belongs to a direction that K does not see. Its inverse is 0, so that the solution has no part
/// along it.
template <Team TeamT, class Real, int kStride, class Floor>
STICTION_HD void factor_square(TeamT& team, const SquareMatrix<Real, kStride>& K, Strided<Real, kStride> inverse,
                               const Floor& floor) {
  constexpr Index kTile = TeamT::kRowTile < 4 ? TeamT::kRowTile : 4;
  const Index n = K.n;
  for (Index first = 0; first < n; first += kPanel) {
    const Index width = n - first < kPanel ? n - first : kPanel;
    for_each(team, first, [&](Index k) {
      for (Index c = first; c < first + width; ++c) K(k, c) = K(c, k) * inverse[k];
    });
    for_each(team, (n - first + kTile - 1) / kTile, [&](Index tile) {
      const Index row = first + tile * kTile;
      if (row + kTile <= n) {
        reduce_rows<kTile>(K, row, first, width);
      } else {
        for (Index i = row; i < n; ++i) reduce_rows<1>(K, i, first, width);
      }
    });
    for (Index j = first; j < first + width; ++j) {
      single(team, [&] {
        inverse[j] = select(K(j, j) > floor(j), div_(Real(1), K(j, j)), Real(0));
        for (Index c = j + 1; c < first + width; ++c) K(j, c) = K(c, j) * inverse[j];
      });
      for_each(team, n - j - 1, [&](Index r) {
        const Index i = j + 1 + r;
        const Real value = Real(0) - K(i, j);
        for (Index c = j + 1; c < first + width && c <= i; ++c) K(i, c) = fma_(value, K(j, c), K(i, c));
      });
    }
  }
}

/// v = K^-1 v by the factor.
template <Team TeamT, class Real, int kStride>
STICTION_HD void solve_square(TeamT& team, const SquareMatrix<Real, kStride>& K, Strided<Real, kStride> inverse,
                              Strided<Real, kStride> v) {
  const Index n = K.n;
  for (Index j = 0; j + 1 < n; ++j) {
    const Real known = Real(0) - v[j] * inverse[j];
    for_each(team, n - j - 1, [&](Index k) {
      const Index i = j + 1 + k;
      v[i] = fma_(K(i, j), known, v[i]);
    });
  }
  for_each(team, n, [&](Index i) { v[i] = v[i] * inverse[i]; });
  for (Index j = n - 1; j > 0; --j) {
    const Real known = Real(0) - v[j];
    for_each(team, j, [&](Index i) { v[i] = fma_(K(i, j), known, v[i]); });
  }
}

}  // namespace stiction::inline STICTION_ISA
