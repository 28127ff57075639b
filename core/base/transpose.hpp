#pragma once

#include "core/base/macros.hpp"
#include "stiction/types.hpp"
#if defined(__AVX__)
#include <immintrin.h>
#endif

/// Square tiles of numbers turned over. Numbers are moved and never computed with.
namespace stiction::inline STICTION_ISA {

/// Edge of the tile that one transposition moves: as many numbers as a vector holds, 1 without vectors.
#if defined(__AVX__)
template <class Real>
inline constexpr Index kTileEdge = 32 / static_cast<Index>(sizeof(Real));
#else
template <class Real>
inline constexpr Index kTileEdge = 1;
#endif

/// to[j][i] = from[i][j] for all i, j < kTileEdge. No alignment is required.
template <class Real>
STICTION_HD void transpose_tile(const Real* const (&from)[kTileEdge<Real>],
                                Real (&to)[kTileEdge<Real>][kTileEdge<Real>]) {
  for (Index i = 0; i < kTileEdge<Real>; ++i)
    for (Index j = 0; j < kTileEdge<Real>; ++j) to[j][i] = from[i][j];
}

#if defined(__AVX__)
STICTION_HD void transpose_tile(const double* const (&from)[4], double (&to)[4][4]) {
  const __m256d a = _mm256_loadu_pd(from[0]), b = _mm256_loadu_pd(from[1]);
  const __m256d c = _mm256_loadu_pd(from[2]), d = _mm256_loadu_pd(from[3]);
  const __m256d ab_even = _mm256_unpacklo_pd(a, b), ab_odd = _mm256_unpackhi_pd(a, b);
  const __m256d cd_even = _mm256_unpacklo_pd(c, d), cd_odd = _mm256_unpackhi_pd(c, d);
  _mm256_storeu_pd(to[0], _mm256_permute2f128_pd(ab_even, cd_even, 0x20));
  _mm256_storeu_pd(to[1], _mm256_permute2f128_pd(ab_odd, cd_odd, 0x20));
  _mm256_storeu_pd(to[2], _mm256_permute2f128_pd(ab_even, cd_even, 0x31));
  _mm256_storeu_pd(to[3], _mm256_permute2f128_pd(ab_odd, cd_odd, 0x31));
}

STICTION_HD void transpose_tile(const float* const (&from)[8], float (&to)[8][8]) {
  // Halves of rows i and i + 4 side by side first; after that all is done within halves.
  for (int half = 0; half < 2; ++half) {
    __m256 row[4];
    for (int i = 0; i < 4; ++i)
      row[i] = _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps(from[i] + 4 * half)),
                                    _mm_loadu_ps(from[i + 4] + 4 * half), 1);
    const __m256 low_01 = _mm256_unpacklo_ps(row[0], row[1]), high_01 = _mm256_unpackhi_ps(row[0], row[1]);
    const __m256 low_23 = _mm256_unpacklo_ps(row[2], row[3]), high_23 = _mm256_unpackhi_ps(row[2], row[3]);
    _mm256_storeu_ps(to[4 * half + 0], _mm256_shuffle_ps(low_01, low_23, 0x44));
    _mm256_storeu_ps(to[4 * half + 1], _mm256_shuffle_ps(low_01, low_23, 0xEE));
    _mm256_storeu_ps(to[4 * half + 2], _mm256_shuffle_ps(high_01, high_23, 0x44));
    _mm256_storeu_ps(to[4 * half + 3], _mm256_shuffle_ps(high_01, high_23, 0xEE));
  }
}
#endif

}  // namespace stiction::inline STICTION_ISA
