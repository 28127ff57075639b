#pragma once

#include <cstdint>
#if defined(__SSE2__)
#include <immintrin.h>
#endif

#include "core/base/pack.hpp"

namespace stiction::inline STICTION_ISA {

/// The lowest and the highest bit of a word that is not 0.
STICTION_HD Index lowest_bit(std::uint64_t word) {
#if defined(__CUDA_ARCH__)
  return static_cast<Index>(__ffsll(static_cast<long long>(word))) - 1;
#else
  return static_cast<Index>(__builtin_ctzll(word));
#endif
}
STICTION_HD Index highest_bit(std::uint64_t word) {
#if defined(__CUDA_ARCH__)
  return 63 - static_cast<Index>(__clzll(static_cast<long long>(word)));
#else
  return 63 - static_cast<Index>(__builtin_clzll(word));
#endif
}

/// Counts the bits that are set.
STICTION_HD Index bit_count(std::uint64_t word) {
#if defined(__CUDA_ARCH__)
  return static_cast<Index>(__popcll(word));
#else
  return static_cast<Index>(__builtin_popcountll(word));
#endif
}

/// Bit k as bit 63 - k.
STICTION_HD std::uint64_t reversed_bits(std::uint64_t word) {
  constexpr std::uint64_t kMasks[] = {0x5555555555555555U, 0x3333333333333333U, 0x0F0F0F0F0F0F0F0FU,
                                      0x00FF00FF00FF00FFU, 0x0000FFFF0000FFFFU, 0x00000000FFFFFFFFU};
  for (int i = 0; i < 6; ++i) word = (word >> (1 << i) & kMasks[i]) | (word & kMasks[i]) << (1 << i);
  return word;
}

/// Bit k: the k-th of `count` <= 64 numbers is not zero. NaN is not zero.
template <class Real>
STICTION_HD std::uint64_t nonzero_of(const Real* numbers, Index count) {
  std::uint64_t set = 0;
  Index k = 0;
#if defined(__AVX512F__) && defined(__AVX512DQ__) && !defined(__CUDA_ARCH__) && !defined(__SANITIZE_ADDRESS__)
  constexpr Index kWidth = 64 / static_cast<Index>(sizeof(Real));
  for (; k < count; k += kWidth) {
    const Index rest = count - k;
    const unsigned here = rest < kWidth ? (1U << rest) - 1U : (1U << (kWidth - 1)) * 2U - 1U;
    if constexpr (sizeof(Real) == sizeof(double)) {
      const __m512d values = _mm512_maskz_loadu_pd(static_cast<__mmask8>(here), numbers + k);
      set |= static_cast<std::uint64_t>(_mm512_cmp_pd_mask(values, _mm512_setzero_pd(), _CMP_NEQ_UQ)) << k;
    } else {
      const __m512 values = _mm512_maskz_loadu_ps(static_cast<__mmask16>(here), numbers + k);
      set |= static_cast<std::uint64_t>(_mm512_cmp_ps_mask(values, _mm512_setzero_ps(), _CMP_NEQ_UQ)) << k;
    }
  }
#elif defined(__AVX2__) && !defined(__CUDA_ARCH__)
  constexpr int kWidth = 32 / static_cast<int>(sizeof(Real));
  for (; k + kWidth <= count; k += kWidth) {
    Pack<Real, kWidth> values;
    load_lanes(numbers + k, values);
    set |= static_cast<std::uint64_t>(lane_bits(values != Pack<Real, kWidth>(0))) << k;
  }
#elif defined(__SSE2__) && !defined(__CUDA_ARCH__)
  constexpr Index kWidth = 16 / static_cast<Index>(sizeof(Real));
  for (; k + kWidth <= count; k += kWidth) {
    int here = 0;
    if constexpr (sizeof(Real) == sizeof(double))
      here = _mm_movemask_pd(_mm_cmpneq_pd(_mm_loadu_pd(numbers + k), _mm_setzero_pd()));
    else
      here = _mm_movemask_ps(_mm_cmpneq_ps(_mm_loadu_ps(numbers + k), _mm_setzero_ps()));
    set |= static_cast<std::uint64_t>(here) << k;
  }
#endif
  for (; k < count; ++k) set |= static_cast<std::uint64_t>(numbers[k] != Real(0)) << k;
  return set;
}

}  // namespace stiction::inline STICTION_ISA
