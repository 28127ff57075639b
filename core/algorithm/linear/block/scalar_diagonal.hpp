#pragma once

#include "core/algorithm/linear/block/block_matrix.hpp"

namespace stiction::inline STICTION_ISA {

/// Jacobi's preconditioner: the inverse of every diagonal entry; 1 where there is none that is positive.
struct ScalarDiagonal {
  Index rows = 0;             ///< of blocks
  double* inverse = nullptr;  ///< (6 rows)

  static constexpr Offset doubles(Offset rows) { return rows * kBodyBlock; }

  template <Team TeamT>
  STICTION_HD_OUTLINE void prepare(TeamT& team, const BlockMatrix& H) const {
    for_each(team, rows, [&](Index row) {
      double* const out = inverse + static_cast<Offset>(row) * kBodyBlock;
      for (Index i = 0; i < kBodyBlock; ++i) out[i] = 1.0;
      for (Index k = H.pattern.offsets[row]; k < H.pattern.offsets[row + 1]; ++k)
        if (H.pattern.columns[k] == row)
          for (Index i = 0; i < kBodyBlock; ++i) {
            const double entry = H.block(k)[i * (kBodyBlock + 1)];
            out[i] = entry > 0.0 ? div_(1.0, entry) : 1.0;
          }
    });
  }

  template <Team TeamT>
  STICTION_HD_OUTLINE void apply(TeamT& team, const double* r, double* z) const {
    for_each(team, rows * kBodyBlock, [&](Index i) { z[i] = inverse[i] * r[i]; });
  }
};

}  // namespace stiction::inline STICTION_ISA
