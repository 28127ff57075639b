#pragma once

#include "core/body/linear/block_matrix.hpp"

namespace stiction::inline STICTION_ISA {

/// Jacobi preconditioner: the inverse of the diagonal.
struct ScalarDiagonal {
  Index rows = 0;             ///< of blocks
  double* inverse = nullptr;  ///< (6 rows)

  static STICTION_HD constexpr Offset doubles(Offset rows) { return rows * kBodyBlock; }

  template <Block B>
  STICTION_HD_OUTLINE void prepare(B& block, const BlockMatrix& A) const {
    for_each(block, rows, [&](Index row) {
      for (Index k = A.pattern.offsets[row]; k < A.pattern.offsets[row + 1]; ++k) {
        if (A.pattern.columns[k] != row) continue;
        for (Index i = 0; i < kBodyBlock; ++i) {
          const double entry = A.block(k)[i * kBodyBlock + i];
          inverse[static_cast<Offset>(row) * kBodyBlock + i] = entry > 0.0 ? div_(1.0, entry) : 0.0;
        }
      }
    });
  }

  template <Block B>
  STICTION_HD_OUTLINE void apply(B& block, const double* r, double* z) const {
    for_each(block, rows * kBodyBlock, [&](Index i) { z[i] = inverse[i] * r[i]; });
  }
};

}  // namespace stiction::inline STICTION_ISA
