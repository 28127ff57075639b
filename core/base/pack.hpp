#pragma once

#include <cstdint>
#include <type_traits>

#if defined(__AVX__)
#include <immintrin.h>
#elif defined(__aarch64__)
#include <arm_neon.h>
#endif

#include "core/base/real.hpp"

/// W environments in lock-step, one per lane, on the compilers' vector extension. Each lane performs exactly the
/// operations the scalar would, so a pack changes speed and not one bit. Host only.
namespace stiction::inline STICTION_ISA {

/// W numbers as one vector of the compiler. The element is spelled out because g++ drops the attribute on a dependent
/// one.
template <class T, int W>
struct VectorOf;
template <int W>
struct VectorOf<float, W> {
  typedef float Type __attribute__((vector_size(4 * W)));
  typedef float Anywhere __attribute__((vector_size(4 * W), aligned(4), may_alias));
};
template <int W>
struct VectorOf<double, W> {
  typedef double Type __attribute__((vector_size(8 * W)));
  typedef double Anywhere __attribute__((vector_size(8 * W), aligned(8), may_alias));
};
template <int W>
struct VectorOf<std::int32_t, W> {
  typedef std::int32_t Type __attribute__((vector_size(4 * W)));
};
template <int W>
struct VectorOf<std::int64_t, W> {
  typedef std::int64_t Type __attribute__((vector_size(8 * W)));
};

template <class T, int W>
struct Pack {
  using Vector = typename VectorOf<T, W>::Type;
  Vector v;

  Pack() = default;
  STICTION_HD Pack(Vector value) : v(value) {}
  /// Every lane the same.
  STICTION_HD explicit Pack(T value) : v(value - Vector{}) {}
  template <class U>
    requires(std::is_arithmetic_v<U> && !std::is_same_v<U, T>)
  STICTION_HD explicit Pack(U value) : Pack(static_cast<T>(value)) {}

  friend STICTION_HD Pack operator+(Pack a, Pack b) { return a.v + b.v; }
  friend STICTION_HD Pack operator-(Pack a, Pack b) { return a.v - b.v; }
  friend STICTION_HD Pack operator*(Pack a, Pack b) { return a.v * b.v; }
  friend STICTION_HD Pack operator-(Pack a) { return -a.v; }
  friend STICTION_HD Pack operator&(Pack a, T bits)
    requires std::is_integral_v<T>
  {
    return a.v & bits;
  }
};

/// Lane-wise truth: all bits set or none.
template <class T, int W>
struct PackMask {
  using Word = std::conditional_t<sizeof(T) == 4, std::int32_t, std::int64_t>;
  using Vector = typename VectorOf<Word, W>::Type;
  Vector v;
};

template <class T, int W>
struct RealTraits<Pack<T, W>> {
  using Scalar = T;
  using Mask = PackMask<T, W>;
  using Counts = Pack<Index, W>;
  static constexpr int kLanes = W;
};

template <class T, int W>
STICTION_HD PackMask<T, W> operator<(Pack<T, W> a, Pack<T, W> b) {
  return {a.v < b.v};
}
template <class T, int W>
STICTION_HD PackMask<T, W> operator>(Pack<T, W> a, Pack<T, W> b) {
  return {a.v > b.v};
}
template <class T, int W>
STICTION_HD PackMask<T, W> operator<=(Pack<T, W> a, Pack<T, W> b) {
  return {a.v <= b.v};
}
template <class T, int W>
STICTION_HD PackMask<T, W> operator>=(Pack<T, W> a, Pack<T, W> b) {
  return {a.v >= b.v};
}
template <class T, int W>
STICTION_HD PackMask<T, W> operator==(Pack<T, W> a, Pack<T, W> b) {
  return {a.v == b.v};
}
template <class T, int W>
STICTION_HD PackMask<T, W> operator!=(Pack<T, W> a, Pack<T, W> b) {
  return {a.v != b.v};
}
template <class T, int W>
STICTION_HD PackMask<T, W> not_(PackMask<T, W> a) {
  return {~a.v};
}
template <class T, int W>
STICTION_HD PackMask<T, W> and_(PackMask<T, W> a, PackMask<T, W> b) {
  return {a.v & b.v};
}
template <class T, int W>
STICTION_HD PackMask<T, W> or_(PackMask<T, W> a, PackMask<T, W> b) {
  return {a.v | b.v};
}
/// Bit l: lane l.
template <class T, int W>
STICTION_HD unsigned lane_bits(PackMask<T, W> a) {
  unsigned bits = 0;
  for (int lane = 0; lane < W; ++lane) bits |= (a.v[lane] != 0 ? 1U : 0U) << lane;
  return bits;
}
template <class T, int W>
STICTION_HD Pack<T, W> select(PackMask<T, W> c, Pack<T, W> a, Pack<T, W> b) {
  return Pack<T, W>(c.v ? a.v : b.v);
}
template <class T, int W>
STICTION_HD Pack<T, W> div_(Pack<T, W> a, Pack<T, W> b) {
  return a.v / b.v;
}

/// No alignment is required. Whole vectors: numbers stored in halves, as g++ copies memory, are slow to load again.
template <class T, int W>
STICTION_HD void load_lanes(const T* from, Pack<T, W>& to) {
  to.v = *reinterpret_cast<const typename VectorOf<T, W>::Anywhere*>(from);
}
template <class T, int W>
STICTION_HD void store_lanes(T* to, Pack<T, W> value) {
  *reinterpret_cast<typename VectorOf<T, W>::Anywhere*>(to) = value.v;
}

/// Lane by lane through the scalar: the fallback of the overloads below.
template <class T, int W>
STICTION_HD Pack<T, W> fma_(Pack<T, W> a, Pack<T, W> b, Pack<T, W> c) {
  Pack<T, W> r;
  for (int lane = 0; lane < W; ++lane) r.v[lane] = fma_(a.v[lane], b.v[lane], c.v[lane]);
  return r;
}
template <class T, int W>
STICTION_HD Pack<T, W> sqrt_(Pack<T, W> a) {
  Pack<T, W> r;
  for (int lane = 0; lane < W; ++lane) r.v[lane] = sqrt_(a.v[lane]);
  return r;
}

#if defined(__AVX512F__) && defined(__AVX512DQ__)
STICTION_HD Pack<float, 16> fma_(Pack<float, 16> a, Pack<float, 16> b, Pack<float, 16> c) {
  return Pack<float, 16>(_mm512_fmadd_ps(a.v, b.v, c.v));
}
STICTION_HD Pack<double, 8> fma_(Pack<double, 8> a, Pack<double, 8> b, Pack<double, 8> c) {
  return Pack<double, 8>(_mm512_fmadd_pd(a.v, b.v, c.v));
}
STICTION_HD Pack<float, 16> sqrt_(Pack<float, 16> a) {
  return Pack<float, 16>(_mm512_sqrt_ps(a.v));
}
STICTION_HD Pack<double, 8> sqrt_(Pack<double, 8> a) {
  return Pack<double, 8>(_mm512_sqrt_pd(a.v));
}
STICTION_HD unsigned lane_bits(PackMask<float, 16> a) {
  return static_cast<unsigned>(_mm512_movepi32_mask((__m512i)a.v));
}
STICTION_HD unsigned lane_bits(PackMask<double, 8> a) {
  return static_cast<unsigned>(_mm512_movepi64_mask((__m512i)a.v));
}
#endif

#if defined(__AVX2__) && defined(__FMA__)
STICTION_HD Pack<float, 8> fma_(Pack<float, 8> a, Pack<float, 8> b, Pack<float, 8> c) {
  return Pack<float, 8>(_mm256_fmadd_ps(a.v, b.v, c.v));
}
STICTION_HD Pack<double, 4> fma_(Pack<double, 4> a, Pack<double, 4> b, Pack<double, 4> c) {
  return Pack<double, 4>(_mm256_fmadd_pd(a.v, b.v, c.v));
}
STICTION_HD Pack<float, 8> sqrt_(Pack<float, 8> a) {
  return Pack<float, 8>(_mm256_sqrt_ps(a.v));
}
STICTION_HD Pack<double, 4> sqrt_(Pack<double, 4> a) {
  return Pack<double, 4>(_mm256_sqrt_pd(a.v));
}
STICTION_HD unsigned lane_bits(PackMask<float, 8> a) {
  return static_cast<unsigned>(_mm256_movemask_ps((__m256)a.v));
}
STICTION_HD unsigned lane_bits(PackMask<double, 4> a) {
  return static_cast<unsigned>(_mm256_movemask_pd((__m256d)a.v));
}
#endif

#if defined(__aarch64__) && defined(__ARM_NEON)
STICTION_HD Pack<float, 4> fma_(Pack<float, 4> a, Pack<float, 4> b, Pack<float, 4> c) {
  return Pack<float, 4>(vfmaq_f32(c.v, a.v, b.v));
}
STICTION_HD Pack<double, 2> fma_(Pack<double, 2> a, Pack<double, 2> b, Pack<double, 2> c) {
  return Pack<double, 2>(vfmaq_f64(c.v, a.v, b.v));
}
STICTION_HD Pack<float, 4> sqrt_(Pack<float, 4> a) {
  return Pack<float, 4>(vsqrtq_f32(a.v));
}
STICTION_HD Pack<double, 2> sqrt_(Pack<double, 2> a) {
  return Pack<double, 2>(vsqrtq_f64(a.v));
}
STICTION_HD unsigned lane_bits(PackMask<float, 4> a) {
  constexpr uint32x4_t kLanes = {1, 2, 4, 8};
  return vaddvq_u32(vandq_u32((uint32x4_t)a.v, kLanes));
}
STICTION_HD unsigned lane_bits(PackMask<double, 2> a) {
  constexpr uint64x2_t kLanes = {1, 2};
  return static_cast<unsigned>(vaddvq_u64(vandq_u64((uint64x2_t)a.v, kLanes)));
}
#endif

template <class T, int W>
STICTION_HD bool any(PackMask<T, W> a) {
  return lane_bits(a) != 0;
}

/// Returns true if a mask is set in one lane.
STICTION_HD bool is_set(bool mask, int) {
  return mask;
}
template <class T, int W>
STICTION_HD bool is_set(PackMask<T, W> mask, int lane) {
  return (lane_bits(mask) >> lane & 1U) != 0;
}

template <class Real, int W>
  requires(RealTraits<Real>::kLanes == W)
STICTION_HD Real narrowed(Pack<double, W> x) {
  return Real(__builtin_convertvector(x.v, typename Real::Vector));
}
/// Masks of Reals and of counts: true is all bits of either.
template <class Real, int W>
  requires(RealTraits<Real>::kLanes == W)
STICTION_HD Mask<Real> of_reals(PackMask<Index, W> of_counts) {
  return {__builtin_convertvector(of_counts.v, typename Mask<Real>::Vector)};
}
template <class Real>
  requires(RealTraits<Real>::kLanes > 1)
STICTION_HD Mask<Counts<Real>> of_counts(Mask<Real> of_reals) {
  return {__builtin_convertvector(of_reals.v, typename Mask<Counts<Real>>::Vector)};
}
template <class Real, int W>
  requires(RealTraits<Real>::kLanes == W)
STICTION_HD Real as_reals(Pack<Index, W> counts) {
  return Real(__builtin_convertvector(counts.v, typename Real::Vector));
}

}  // namespace stiction::inline STICTION_ISA
