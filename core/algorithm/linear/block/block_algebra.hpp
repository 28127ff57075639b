#pragma once

#include "core/algorithm/linear/block/block_diagonal.hpp"

/// Operations of factorisations on single 6 x 6 blocks. Every entry is summed by one lane in ascending order.
namespace stiction::inline STICTION_ISA {

/// K = a block of H, or zero for a block that H does not have.
STICTION_HD void load_block(const BlockMatrix& H, Index source, double* K) {
  for (Index k = 0; k < kBlockEntries; ++k) K[k] = source < 0 ? 0.0 : H.block(source)[k];
}

/// K = K - F G'.
STICTION_HD void subtract_outer(const double* F, const double* G, double* K) {
  for (Index i = 0; i < kBodyBlock; ++i)
    for (Index j = 0; j < kBodyBlock; ++j) {
      double entry = K[i * kBodyBlock + j];
      for (Index k = 0; k < kBodyBlock; ++k) entry = fma_(0.0 - F[i * kBodyBlock + k], G[j * kBodyBlock + k], entry);
      K[i * kBodyBlock + j] = entry;
    }
}

/// K = K - F G.
STICTION_HD void subtract_product(const double* F, const double* G, double* K) {
  for (Index i = 0; i < kBodyBlock; ++i)
    for (Index k = 0; k < kBodyBlock; ++k)
      for (Index j = 0; j < kBodyBlock; ++j)
        K[i * kBodyBlock + j] = fma_(0.0 - F[i * kBodyBlock + k], G[k * kBodyBlock + j], K[i * kBodyBlock + j]);
}

/// K = K L^-T, L the lower triangle that factor_block left.
STICTION_HD void divide_by_transpose(const double* L, double* K) {
  for (Index i = 0; i < kBodyBlock; ++i)
    for (Index j = 0; j < kBodyBlock; ++j) {
      double entry = K[i * kBodyBlock + j];
      for (Index k = 0; k < j; ++k) entry = fma_(0.0 - K[i * kBodyBlock + k], L[j * kBodyBlock + k], entry);
      K[i * kBodyBlock + j] = div_(entry, L[j * kBodyBlock + j]);
    }
}

/// K = K L^-1.
STICTION_HD void divide_by_factor(const double* L, double* K) {
  for (Index i = 0; i < kBodyBlock; ++i)
    for (Index j = kBodyBlock - 1; j >= 0; --j) {
      double entry = K[i * kBodyBlock + j];
      for (Index k = j + 1; k < kBodyBlock; ++k)
        entry = fma_(0.0 - K[i * kBodyBlock + k], L[k * kBodyBlock + j], entry);
      K[i * kBodyBlock + j] = div_(entry, L[j * kBodyBlock + j]);
    }
}

/// v = v - K u.
STICTION_HD void subtract_image(const double* K, const double* u, double (&v)[kBodyBlock]) {
  for (Index i = 0; i < kBodyBlock; ++i)
    for (Index j = 0; j < kBodyBlock; ++j) v[i] = fma_(0.0 - K[i * kBodyBlock + j], u[j], v[i]);
}

/// v = v - K' u.
STICTION_HD void subtract_transposed_image(const double* K, const double* u, double (&v)[kBodyBlock]) {
  for (Index i = 0; i < kBodyBlock; ++i)
    for (Index j = 0; j < kBodyBlock; ++j) v[j] = fma_(0.0 - K[i * kBodyBlock + j], u[i], v[j]);
}

}  // namespace stiction::inline STICTION_ISA
