#pragma once

#include "core/base/real.hpp"
#include "stiction/types.hpp"
#if defined(__AVX2__) && defined(__FMA__)
#include "core/base/pack.hpp"
#endif

namespace stiction::inline STICTION_ISA {

/// Adds a(k) x(k) for k in [first, count) to sum k modulo 4; `first` is a multiple of 4. Sums are named by constants
/// for as long as possible, so that they can be registers.
template <class Left, class Right>
STICTION_HD void add_to_four_sums(double (&sum)[4], Index first, Index count, Left&& a, Right&& x) {
  const auto add = [&](int part, Index k) {
    sum[part] = fma_(static_cast<double>(a(k)), static_cast<double>(x(k)), sum[part]);
  };
  Index k = first;
  for (; k + 4 <= count; k += 4)
    for (int part = 0; part < 4; ++part) add(part, k + part);
  for (int part = 0; k < count; ++k, ++part) add(part, k);
}

#if defined(__AVX2__) && defined(__FMA__)
STICTION_HD Pack<double, 4> four_doubles(const float* from) {
  return Pack<double, 4>(_mm256_cvtps_pd(_mm_loadu_ps(from)));
}
STICTION_HD Pack<double, 4> four_doubles(const double* from) {
  return Pack<double, 4>(_mm256_loadu_pd(from));
}
#endif

/// Four interleaved partial sums of products in double: term k of a[k] x[k] goes to sum k modulo 4. Returns
/// (sum 0 + sum 1) + (sum 2 + sum 3), where sum 0 began at `start`. Four neighbours at a time are one vector where
/// there are vectors, with the same bits.
template <class Real, class Other>
STICTION_HD double four_sums(double start, const Real* a, const Other* x, Index count) {
  double sum[4] = {start, 0.0, 0.0, 0.0};
  Index k = 0;
#if defined(__AVX2__) && defined(__FMA__)
  Pack<double, 4> four(_mm256_setr_pd(start, 0.0, 0.0, 0.0));
  for (; k + 4 <= count; k += 4) four = fma_(four_doubles(a + k), four_doubles(x + k), four);
  _mm256_storeu_pd(sum, four.v);
#endif
  add_to_four_sums(sum, k, count, [&](Index i) { return a[i]; }, [&](Index i) { return x[i]; });
  return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

}  // namespace stiction::inline STICTION_ISA
