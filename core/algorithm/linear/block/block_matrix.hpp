#pragma once

#include "core/job/block_pattern.hpp"
#include "core/team/reduce.hpp"

/// Matrices of 6 x 6 blocks of doubles over bodies (docs/math/multigrid.md). Products go in an order that the pattern
/// decides, so that the bits do not depend on how many lanes there are.
namespace stiction::inline STICTION_ISA {

inline constexpr Index kBlockEntries = kBodyBlock * kBodyBlock;

struct BlockMatrix;
/// y = A x.
template <Team TeamT>
STICTION_HD_OUTLINE void multiply_blocks(TeamT& team, const BlockMatrix& A, const double* x, double* y);

/// A pattern with its numbers: each block row by row, blocks in the pattern's order.
struct BlockMatrix {
  BlockPattern pattern;
  double* values = nullptr;

  [[nodiscard]] STICTION_HD double* block(Index k) const { return values + static_cast<Offset>(k) * kBlockEntries; }
  [[nodiscard]] STICTION_HD Index unknowns() const { return pattern.rows * kBodyBlock; }

  /// As an operator (core/algorithm/linear/krylov/cg.hpp).
  template <Team TeamT>
  STICTION_HD void apply(TeamT& on, const double* x, double* y) const {
    multiply_blocks(on, *this, x, y);
  }
};

/// sum = sum + K v for one block.
STICTION_HD void multiply_block(const double* K, const double* v, double (&sum)[kBodyBlock]) {
  for (Index i = 0; i < kBodyBlock; ++i)
    for (Index j = 0; j < kBodyBlock; ++j) sum[i] = fma_(K[i * kBodyBlock + j], v[j], sum[i]);
}

/// sum = sum + K' v.
STICTION_HD void multiply_transposed_block(const double* K, const double* v, double (&sum)[kBodyBlock]) {
  for (Index i = 0; i < kBodyBlock; ++i)
    for (Index j = 0; j < kBodyBlock; ++j) sum[j] = fma_(K[i * kBodyBlock + j], v[i], sum[j]);
}

/// Row `row` of A x, added to `sum` in the order of columns.
STICTION_HD void multiply_row(const BlockMatrix& A, Index row, const double* x, double (&sum)[kBodyBlock]) {
  for (Index k = A.pattern.offsets[row]; k < A.pattern.offsets[row + 1]; ++k)
    multiply_block(A.block(k), x + static_cast<Offset>(A.pattern.columns[k]) * kBodyBlock, sum);
}

template <Team TeamT>
STICTION_HD_OUTLINE void multiply_blocks(TeamT& team, const BlockMatrix& A, const double* x, double* y) {
  for_each(team, A.pattern.rows, [&](Index row) {
    double sum[kBodyBlock] = {};
    multiply_row(A, row, x, sum);
    for (Index i = 0; i < kBodyBlock; ++i) y[static_cast<Offset>(row) * kBodyBlock + i] = sum[i];
  });
}

}  // namespace stiction::inline STICTION_ISA
