#pragma once

#include <cstdint>

#include "core/base/macros.hpp"
#include "stiction/types.hpp"

#ifdef __FAST_MATH__
#error "stiction promises the same bits everywhere; relaxed floating-point flags break that promise. Remove them."
#endif

/// Every rounding of the algorithms goes through these functions (docs/explanation/numerics.md). Plain + - * are
/// written as such; with contraction off each is one IEEE-754 rounding on every machine. Comparisons with NaN are
/// false, and the selects below therefore have one meaning everywhere, unlike the libraries' minima and maxima.
namespace stiction::inline STICTION_ISA {

/// The scalar type of one lane, the type of a comparison of T, and that of a count of something in every lane.
template <class T>
struct RealTraits {
  using Scalar = T;
  using Mask = bool;
  using Counts = Index;
  static constexpr int kLanes = 1;
};
template <class T>
using Mask = typename RealTraits<T>::Mask;
template <class T>
using Scalar = typename RealTraits<T>::Scalar;
template <class T>
using Counts = typename RealTraits<T>::Counts;

#if defined(__CUDA_ARCH__)
STICTION_HD float fma_(float a, float b, float c) {
  return __fmaf_rn(a, b, c);
}
STICTION_HD double fma_(double a, double b, double c) {
  return __fma_rn(a, b, c);
}
STICTION_HD float sqrt_(float a) {
  return __fsqrt_rn(a);
}
STICTION_HD double sqrt_(double a) {
  return __dsqrt_rn(a);
}
STICTION_HD float div_(float a, float b) {
  return __fdiv_rn(a, b);
}
STICTION_HD double div_(double a, double b) {
  return __ddiv_rn(a, b);
}
#else
STICTION_HD float fma_(float a, float b, float c) {
  return __builtin_fmaf(a, b, c);
}
STICTION_HD double fma_(double a, double b, double c) {
  return __builtin_fma(a, b, c);
}
STICTION_HD float sqrt_(float a) {
  return __builtin_sqrtf(a);
}
STICTION_HD double sqrt_(double a) {
  return __builtin_sqrt(a);
}
STICTION_HD float div_(float a, float b) {
  return a / b;
}
STICTION_HD double div_(double a, double b) {
  return a / b;
}
#endif

/// The numbers at an address into the lanes, and back: one of each here, as many as a Pack has lanes there.
STICTION_HD void load_lanes(const float* from, float& to) {
  to = *from;
}
STICTION_HD void load_lanes(const double* from, double& to) {
  to = *from;
}
STICTION_HD void store_lanes(float* to, float value) {
  *to = value;
}
STICTION_HD void store_lanes(double* to, double value) {
  *to = value;
}

STICTION_HD float select(bool c, float a, float b) {
  return c ? a : b;
}
STICTION_HD double select(bool c, double a, double b) {
  return c ? a : b;
}
STICTION_HD Index select(bool c, Index a, Index b) {
  return c ? a : b;
}
STICTION_HD bool any(bool c) {
  return c;
}
STICTION_HD bool not_(bool c) {
  return !c;
}
STICTION_HD bool and_(bool a, bool b) {
  return a && b;
}
STICTION_HD bool or_(bool a, bool b) {
  return a || b;
}

/// max(a, b) as a select: b wins ties, and a NaN in `a` yields b.
template <class T>
STICTION_HD T max_(T a, T b) {
  return select(a > b, a, b);
}
/// min(a, b) as a select: b wins ties, and a NaN in `a` yields b.
template <class T>
STICTION_HD T min_(T a, T b) {
  return select(a < b, a, b);
}
/// Converts the truth of counts of Reals into the truth of Reals, and back.
template <class Real>
STICTION_HD bool of_reals(bool of_counts) {
  return of_counts;
}
template <class Real>
STICTION_HD bool of_counts(bool of_reals) {
  return of_reals;
}
/// Counts as Reals, rounded where they are too large.
template <class Real>
STICTION_HD Real as_reals(Index count) {
  return static_cast<Real>(count);
}
/// A double as a Real, rounded.
template <class Real>
STICTION_HD Real narrowed(double x) {
  return static_cast<Real>(x);
}
/// x clipped to [lo, hi].
template <class T>
STICTION_HD T clamp_(T x, T lo, T hi) {
  return select(x < lo, lo, select(x > hi, hi, x));
}
template <class T>
STICTION_HD T abs_(T x) {
  return select(x < T(0), T(0) - x, x);
}
/// -0 becomes +0, all else stays: signs of zero are where equal algorithms differ first, so none is stored.
template <class T>
STICTION_HD T canonical_zero(T x) {
  return x + T(0);
}
/// Neither infinite nor NaN: infinity minus infinity is NaN, and NaN equals nothing.
template <class T>
STICTION_HD Mask<T> finite_(T x) {
  return (x - x) == T(0);
}

/// A number as its bits: -0 differs from +0, and a NaN equals itself.
STICTION_HD std::uint32_t bits_of(float x) {
  union {
    float f;
    std::uint32_t u;
  } bits{x};
  return bits.u;
}
STICTION_HD std::uint64_t bits_of(double x) {
  union {
    double f;
    std::uint64_t u;
  } bits{x};
  return bits.u;
}

/// The power of two s for which s * x lies in [1, 2), for finite positive normal x; 1 for anything else. Multiplying
/// by it is exact, so a system can be brought to unit scale without a rounding.
STICTION_HD float unit_scale(float x) {
  union {
    std::uint32_t u;
    float f;
  } bits{bits_of(x)};
  const std::uint32_t exponent = (bits.u >> 23) & 0xffU;
  if (!(x > 0.0F) || exponent < 1U || exponent > 253U) return 1.0F;
  bits.u = (254U - exponent) << 23;
  return bits.f;
}
STICTION_HD double unit_scale(double x) {
  union {
    std::uint64_t u;
    double f;
  } bits{bits_of(x)};
  const std::uint64_t exponent = (bits.u >> 52) & 0x7ffU;
  if (!(x > 0.0) || exponent < 1U || exponent > 2045U) return 1.0;
  bits.u = (2046U - exponent) << 52;
  return bits.f;
}

}  // namespace stiction::inline STICTION_ISA
