#pragma once

#include "core/algorithm/linear/block/block_matrix.hpp"

/// Products of matrices of blocks whose patterns are known. One lane owns a block of the result and gathers its terms
/// in the order of the left factor's columns.
namespace stiction::inline STICTION_ISA {

/// The number of the block in `row` and `column`, -1 where there is none.
STICTION_HD Index find_block(const BlockPattern& pattern, Index row, Index column) {
  Index low = pattern.offsets[row];
  Index high = pattern.offsets[row + 1];
  while (low < high) {
    const Index middle = low + (high - low) / 2;
    if (pattern.columns[middle] < column)
      low = middle + 1;
    else
      high = middle;
  }
  return low < pattern.offsets[row + 1] && pattern.columns[low] == column ? low : -1;
}

/// The row of block `k`.
STICTION_HD Index row_of_block(const BlockPattern& pattern, Index k) {
  Index low = 0;
  Index high = pattern.rows;
  while (high - low > 1) {
    const Index middle = low + (high - low) / 2;
    if (pattern.offsets[middle] <= k)
      low = middle;
    else
      high = middle;
  }
  return low;
}

/// sum = sum + K T, or K' T.
template <bool kTransposed>
STICTION_HD_OUTLINE void add_block_product(const double* K, const double* T, double* sum) {
  for (Index i = 0; i < kBodyBlock; ++i)
    for (Index k = 0; k < kBodyBlock; ++k) {
      const double factor = kTransposed ? K[k * kBodyBlock + i] : K[i * kBodyBlock + k];
      for (Index j = 0; j < kBodyBlock; ++j)
        sum[i * kBodyBlock + j] = fma_(factor, T[k * kBodyBlock + j], sum[i * kBodyBlock + j]);
    }
}

/// The transpose of a matrix that is stored once: its pattern, and of each of its blocks the number in `original`.
struct TransposedMatrix {
  BlockPattern pattern;
  const Index* block;
  BlockMatrix original;
};

/// sum = sum + (block l of the factor) T.
STICTION_HD void add_term(const BlockMatrix& factor, Index l, const double* T, double* sum) {
  add_block_product<false>(factor.block(l), T, sum);
}
STICTION_HD void add_term(const TransposedMatrix& factor, Index l, const double* T, double* sum) {
  add_block_product<true>(factor.original.block(factor.block[l]), T, sum);
}

/// product = left right, where `left` is a matrix or a transposed one and product.pattern has every block that is not
/// 0.
template <Team TeamT, class Left>
STICTION_HD_OUTLINE void multiply_matrices(TeamT& team, const Left& left, const BlockMatrix& right,
                                           const BlockMatrix& product) {
  for_each(team, product.pattern.blocks(), [&](Index k) {
    const Index row = row_of_block(product.pattern, k);
    double sum[kBlockEntries] = {};
    for (Index l = left.pattern.offsets[row]; l < left.pattern.offsets[row + 1]; ++l) {
      const Index r = find_block(right.pattern, left.pattern.columns[l], product.pattern.columns[k]);
      if (r >= 0) add_term(left, l, right.block(r), sum);
    }
    for (Index i = 0; i < kBlockEntries; ++i) product.block(k)[i] = sum[i];
  });
}

/// y = y + A x, where x is not y.
template <Team TeamT>
STICTION_HD_OUTLINE void add_product(TeamT& team, const BlockMatrix& A, const double* x, double* y) {
  for_each(team, A.pattern.rows, [&](Index row) {
    double sum[kBodyBlock] = {};
    multiply_row(A, row, x, sum);
    for (Index i = 0; i < kBodyBlock; ++i) {
      double& entry = y[static_cast<Offset>(row) * kBodyBlock + i];
      entry = entry + sum[i];
    }
  });
}

/// y = A' x.
template <Team TeamT>
STICTION_HD_OUTLINE void multiply_transposed(TeamT& team, const TransposedMatrix& A, const double* x, double* y) {
  for_each(team, A.pattern.rows, [&](Index row) {
    double sum[kBodyBlock] = {};
    for (Index l = A.pattern.offsets[row]; l < A.pattern.offsets[row + 1]; ++l)
      multiply_transposed_block(A.original.block(A.block[l]),
                                x + static_cast<Offset>(A.pattern.columns[l]) * kBodyBlock, sum);
    for (Index i = 0; i < kBodyBlock; ++i) y[static_cast<Offset>(row) * kBodyBlock + i] = sum[i];
  });
}

}  // namespace stiction::inline STICTION_ISA
