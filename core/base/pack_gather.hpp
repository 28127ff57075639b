#pragma once

#include "core/base/pack.hpp"

/// Numbers of a pack that lie at a separate place for each lane. Host only.
namespace stiction::inline STICTION_ISA {

/// An integer for each lane, as wide as the numbers: the type of indices.
template <class T, int W>
using PackIndices = typename PackMask<T, W>::Vector;

/// base[place] in every lane. Without AVX-512 by loads of single numbers: AVX2's gather instructions take longer on Zen
/// (bench/log).
template <class T, int W>
STICTION_HD Pack<T, W> gather(const T* base, PackIndices<T, W> index) {
  Pack<T, W> r;
  for (int lane = 0; lane < W; ++lane) r.v[lane] = base[index[lane]];
  return r;
}
/// base[place] = value in every lane; no two places are the same.
template <class T, int W>
STICTION_HD void scatter(T* base, PackIndices<T, W> index, Pack<T, W> value) {
  for (int lane = 0; lane < W; ++lane) base[index[lane]] = value.v[lane];
}

#if defined(__AVX512F__) && defined(__AVX512DQ__) && !defined(__SANITIZE_ADDRESS__)  // it checks loads, and no gathers
template <>
STICTION_HD Pack<float, 16> gather<float, 16>(const float* base, PackIndices<float, 16> index) {
  return Pack<float, 16>(_mm512_i32gather_ps((__m512i)index, base, 4));
}
template <>
STICTION_HD Pack<double, 8> gather<double, 8>(const double* base, PackIndices<double, 8> index) {
  return Pack<double, 8>(_mm512_i64gather_pd((__m512i)index, base, 8));
}
template <>
STICTION_HD void scatter<float, 16>(float* base, PackIndices<float, 16> index, Pack<float, 16> value) {
  _mm512_i32scatter_ps(base, (__m512i)index, value.v, 4);
}
template <>
STICTION_HD void scatter<double, 8>(double* base, PackIndices<double, 8> index, Pack<double, 8> value) {
  _mm512_i64scatter_pd(base, (__m512i)index, value.v, 8);
}
#endif

}  // namespace stiction::inline STICTION_ISA
