#pragma once

#include "core/algorithm/linear/block/block_algebra.hpp"
#include "core/job/sparse_inverse_view.hpp"

namespace stiction::inline STICTION_ISA {

/// Factored sparse approximate inverse G'G of H, G lower triangular on H's pattern (Kolotilina and Yeremin 1993). With
/// H = L L', the G of that pattern that minimises |I - G L|_F solves one small system per block row. L no longer
/// appears in it but for the scale of each block row. The scale is chosen so that the diagonal blocks of G H G' are
/// the identity (docs/math/preconditioners.md). Symmetric and positive definite whatever H; two products to apply.
struct SparseInverse {
  SparseInverseView plan;
  double* values = nullptr;  ///< G                                            (36 plan.lower.blocks())
  double* dense = nullptr;   ///< each row's own system, then its factor       (36 plan.dense_offsets[rows])
  double* image = nullptr;   ///< G r                                          (6 rows)

  static constexpr Offset doubles(Offset rows, Offset blocks, Offset dense_blocks) {
    return (blocks + dense_blocks) * kBlockEntries + rows * kBodyBlock;
  }
  /// In memory of doubles().
  static STICTION_HD SparseInverse in(const SparseInverseView& plan, double* memory) {
    SparseInverse inverse;
    inverse.plan = plan;
    inverse.values = memory;
    inverse.dense = inverse.values + static_cast<Offset>(plan.lower.blocks()) * kBlockEntries;
    inverse.image = inverse.dense + static_cast<Offset>(plan.dense_offsets[plan.lower.rows]) * kBlockEntries;
    return inverse;
  }

  template <Team TeamT>
  STICTION_HD_OUTLINE void prepare(TeamT& team, const BlockMatrix& H) const {
    for_each(team, plan.lower.rows, [&](Index row) {
      factor_dense(H, row);
      invert_last_row(row);
    });
  }

  template <Team TeamT>
  STICTION_HD_OUTLINE void apply(TeamT& team, const double* r, double* z) const {
    const BlockMatrix G{plan.lower, values};
    multiply_blocks(team, G, r, image);
    for_each(team, plan.lower.rows, [&](Index column) {
      double sum[kBodyBlock] = {};
      for (Index k = plan.column_offsets[column]; k < plan.column_offsets[column + 1]; ++k)
        multiply_transposed_block(G.block(plan.column_blocks[k]),
                                  image + static_cast<Offset>(plan.column_rows[k]) * kBodyBlock, sum);
      for (Index i = 0; i < kBodyBlock; ++i) z[static_cast<Offset>(column) * kBodyBlock + i] = sum[i];
    });
  }

 private:
  /// Team (i, j) of a row's own system, j <= i.
  [[nodiscard]] STICTION_HD double* dense_block(Index row, Index i, Index j) const {
    return dense + (static_cast<Offset>(plan.dense_offsets[row]) + i * (i + 1) / 2 + j) * kBlockEntries;
  }

  /// Factors H restricted to the columns of row `row`.
  STICTION_HD void factor_dense(const BlockMatrix& H, Index row) const {
    const Index size = plan.lower.offsets[row + 1] - plan.lower.offsets[row];
    for (Index i = 0; i < size; ++i)
      for (Index j = 0; j <= i; ++j) {
        double* const K = dense_block(row, i, j);
        load_block(H, plan.dense_sources[plan.dense_offsets[row] + i * (i + 1) / 2 + j], K);
        for (Index k = 0; k < j; ++k) subtract_outer(dense_block(row, i, k), dense_block(row, j, k), K);
        if (j < i) {
          divide_by_transpose(dense_block(row, j, j), K);
        } else {
          factor_block(K);
        }
      }
  }

  /// Row `row` of G: the last row of that factor's inverse.
  STICTION_HD void invert_last_row(Index row) const {
    const Index first = plan.lower.offsets[row];
    const Index last = plan.lower.offsets[row + 1] - first - 1;
    for (Index j = last; j >= 0; --j) {
      double* const K = values + static_cast<Offset>(first + j) * kBlockEntries;
      for (Index k = 0; k < kBlockEntries; ++k) K[k] = j == last && k % (kBodyBlock + 1) == 0 ? 1.0 : 0.0;
      for (Index i = j + 1; i <= last; ++i)
        subtract_product(values + static_cast<Offset>(first + i) * kBlockEntries, dense_block(row, i, j), K);
      divide_by_factor(dense_block(row, j, j), K);
    }
  }
};

}  // namespace stiction::inline STICTION_ISA
