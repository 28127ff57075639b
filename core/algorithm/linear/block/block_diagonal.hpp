#pragma once

#include "core/algorithm/linear/block/block_matrix.hpp"

namespace stiction::inline STICTION_ISA {

/// Factor L L' of a symmetric positive definite 6 x 6 block, in its lower triangle (Golub and Van Loan 2013, section
/// 4.2.5). A pivot that rounding has made zero or less is replaced: its direction is then left alone.
STICTION_HD void factor_block(double* K) {
  for (Index j = 0; j < kBodyBlock; ++j) {
    double pivot = K[j * kBodyBlock + j];
    for (Index k = 0; k < j; ++k) pivot = fma_(0.0 - K[j * kBodyBlock + k], K[j * kBodyBlock + k], pivot);
    const double root = pivot > 0.0 ? sqrt_(pivot) : 0x1p+500;
    K[j * kBodyBlock + j] = root;
    for (Index i = j + 1; i < kBodyBlock; ++i) {
      double entry = K[i * kBodyBlock + j];
      for (Index k = 0; k < j; ++k) entry = fma_(0.0 - K[i * kBodyBlock + k], K[j * kBodyBlock + k], entry);
      K[i * kBodyBlock + j] = div_(entry, root);
    }
  }
}

/// v = L^-1 v.
STICTION_HD void solve_lower(const double* L, double* v) {
  for (Index i = 0; i < kBodyBlock; ++i) {
    for (Index k = 0; k < i; ++k) v[i] = fma_(0.0 - L[i * kBodyBlock + k], v[k], v[i]);
    v[i] = div_(v[i], L[i * kBodyBlock + i]);
  }
}

/// v = L^-T v.
STICTION_HD void solve_upper(const double* L, double* v) {
  for (Index i = kBodyBlock - 1; i >= 0; --i) {
    for (Index k = i + 1; k < kBodyBlock; ++k) v[i] = fma_(0.0 - L[k * kBodyBlock + i], v[k], v[i]);
    v[i] = div_(v[i], L[i * kBodyBlock + i]);
  }
}

/// v = (L L')^-1 v.
STICTION_HD void solve_block(const double* L, double* v) {
  solve_lower(L, v);
  solve_upper(L, v);
}

/// Team-Jacobi preconditioner: the inverse of every diagonal block.
struct BlockDiagonal {
  Index rows = 0;
  double* factors = nullptr;  ///< (36 rows)

  static STICTION_HD constexpr Offset doubles(Offset rows) { return rows * kBlockEntries; }

  /// Takes A's diagonal blocks; a row without one is left alone.
  template <Team TeamT>
  STICTION_HD_OUTLINE void prepare(TeamT& team, const BlockMatrix& A) const {
    for_each(team, rows, [&](Index row) {
      double* const factor = factors + static_cast<Offset>(row) * kBlockEntries;
      for (Index k = 0; k < kBlockEntries; ++k) factor[k] = k % (kBodyBlock + 1) == 0 ? 1.0 : 0.0;
      for (Index k = A.pattern.offsets[row]; k < A.pattern.offsets[row + 1]; ++k)
        if (A.pattern.columns[k] == row)
          for (Index i = 0; i < kBlockEntries; ++i) factor[i] = A.block(k)[i];
      factor_block(factor);
    });
  }

  /// v = D^-1 v for one row.
  STICTION_HD void solve(Index row, double* v) const {
    solve_block(factors + static_cast<Offset>(row) * kBlockEntries, v);
  }

  template <Team TeamT>
  STICTION_HD_OUTLINE void apply(TeamT& team, const double* r, double* z) const {
    for_each(team, rows, [&](Index row) {
      const Offset first = static_cast<Offset>(row) * kBodyBlock;
      for (Index i = 0; i < kBodyBlock; ++i) z[first + i] = r[first + i];
      solve(row, z + first);
    });
  }
};

}  // namespace stiction::inline STICTION_ISA
