#pragma once

#include "core/base/dot4.hpp"
#include "core/base/pack.hpp"

/// Sums of products of neighbouring rows. Host only.
namespace stiction::inline STICTION_ISA {

#if defined(__AVX2__) && defined(__FMA__)
/// The first `count` < 4 numbers as doubles, then zeros; memory behind them is not touched.
STICTION_HD Pack<double, 4> four_doubles(const float* from, Index count) {
  const __m128i wanted = _mm_cmpgt_epi32(_mm_set1_epi32(count), _mm_setr_epi32(0, 1, 2, 3));
  return Pack<double, 4>(_mm256_cvtps_pd(_mm_maskload_ps(from, wanted)));
}
STICTION_HD Pack<double, 4> four_doubles(const double* from, Index count) {
  const __m256i wanted = _mm256_cmpgt_epi64(_mm256_set1_epi64x(count), _mm256_setr_epi64x(0, 1, 2, 3));
  return Pack<double, 4>(_mm256_maskload_pd(from, wanted));
}
#endif

/// four_sums() of four rows of `count` numbers that lie one after another, each with a separate start. Behind x are
/// zeros up to a multiple of four. The same bits, but for the sign of a zero.
template <class Real>
STICTION_HD Pack<double, 4> four_sums_of_four_rows(Pack<double, 4> start, const Real* a, const double* x, Index count) {
  using Four = Pack<double, 4>;
#if defined(__AVX2__) && defined(__FMA__)
  // Four variables: g++ keeps an array of them in memory.
  const Four zero(0.0);
  const __m256d second = _mm256_permute4x64_pd(start.v, 1);
  const __m256d third = _mm256_permute4x64_pd(start.v, 2);
  const __m256d fourth = _mm256_permute4x64_pd(start.v, 3);
  Four row_0(_mm256_blend_pd(zero.v, start.v, 1)), row_1(_mm256_blend_pd(zero.v, second, 1));
  Four row_2(_mm256_blend_pd(zero.v, third, 1)), row_3(_mm256_blend_pd(zero.v, fourth, 1));
  const Real* const b = a + count;
  const Real* const c = b + count;
  const Real* const d = c + count;
  const auto add = [&](Index k, auto... some) {
    const Four of_all = four_doubles(x + k);
    row_0 = fma_(four_doubles(a + k, some...), of_all, row_0);
    row_1 = fma_(four_doubles(b + k, some...), of_all, row_1);
    row_2 = fma_(four_doubles(c + k, some...), of_all, row_2);
    row_3 = fma_(four_doubles(d + k, some...), of_all, row_3);
  };
  Index k = 0;
  for (; k + 4 <= count; k += 4) add(k);
  if (k < count) add(k, count - k);
  // Neighbours added: sums 0 and 1 of two rows alternately, then their sums 2 and 3.
  const __m256d front = _mm256_hadd_pd(row_0.v, row_1.v);
  const __m256d back = _mm256_hadd_pd(row_2.v, row_3.v);
  return Four(_mm256_permute2f128_pd(front, back, 0x20)) + Four(_mm256_permute2f128_pd(front, back, 0x31));
#else
  Four sum;
  for (int r = 0; r < 4; ++r) sum.v[r] = four_sums(start.v[r], a + Offset{count} * r, x, count);
  return sum;
#endif
}

}  // namespace stiction::inline STICTION_ISA
