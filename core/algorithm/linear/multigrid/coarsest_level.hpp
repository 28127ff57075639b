#pragma once

#include "core/algorithm/linear/block/block_matrix.hpp"
#include "core/algorithm/linear/dense/dense_factor.hpp"

namespace stiction::inline STICTION_ISA {

/// The coarsest level: its coupled bodies as one dense factor.
struct CoarsestLevel {
  const Index* place;        ///< of each body: where it is in the dense matrix, -1 if it is not coupled  (rows)
  Index bodies = 0;          ///< that are
  double* memory = nullptr;  ///< (doubles(bodies))

  static STICTION_HD Offset doubles(Offset bodies) { return bodies * kBodyBlock * (bodies * kBodyBlock + 1); }
  [[nodiscard]] STICTION_HD DenseMatrix dense() const { return {vector() + bodies * kBodyBlock, bodies * kBodyBlock}; }
  [[nodiscard]] STICTION_HD double* vector() const { return memory; }

  template <Team TeamT>
  STICTION_HD_OUTLINE void prepare(TeamT& team, const BlockMatrix& H) const {
    const DenseMatrix K = dense();
    for_each(team, K.n, [&](Index j) {
      for (Index i = 0; i < K.n; ++i) K(i, j) = 0.0;
    });
    for_each(team, H.pattern.rows, [&](Index row) {
      if (place[row] < 0) return;
      for (Index k = H.pattern.offsets[row]; k < H.pattern.offsets[row + 1]; ++k)
        for (Index i = 0; i < kBlockEntries; ++i)
          K(place[row] * kBodyBlock + i / kBodyBlock, place[H.pattern.columns[k]] * kBodyBlock + i % kBodyBlock) =
              H.block(k)[i];
    });
    factor_ldl(team, K, 0.0);
  }

  /// The coupled bodies' part of z = H^-1 r.
  template <Team TeamT>
  STICTION_HD_OUTLINE void solve(TeamT& team, Index rows, const double* r, double* z) const {
    const auto for_each_coupled = [&](auto&& f) {
      for_each(team, rows, [&](Index row) {
        if (place[row] < 0) return;
        for (Index i = 0; i < kBodyBlock; ++i)
          f(vector()[place[row] * kBodyBlock + i], static_cast<Offset>(row) * kBodyBlock + i);
      });
    };
    for_each_coupled([&](double& v, Offset i) { v = r[i]; });
    solve_ldl(team, dense(), vector());
    for_each_coupled([&](double& v, Offset i) { z[i] = v; });
  }
};

}  // namespace stiction::inline STICTION_ISA
