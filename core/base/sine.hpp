#pragma once

#include "core/base/real.hpp"

/// Sine and cosine by products, fused operations and selects, so that no library reaches a bit, and lanes have them.
namespace stiction::inline STICTION_ISA {

template <class Real>
struct SineCosine {
  Real sine, cosine;
};

/// Three parts of pi / 2, the number whose addition rounds to an integer, and the angle up to which parts are enough.
template <class T>
struct QuarterTurn;
template <>
struct QuarterTurn<double> {
  static constexpr double kInverse = 0.63661977236758134308, kRounds = 6755399441055744.0, kMost = 1e9;
  static constexpr double kHigh = 1.5707963267948966192, kMiddle = 6.123233995736766036e-17,
                          kLow = -1.4973849048591833e-33;
};
template <>
struct QuarterTurn<float> {
  static constexpr float kInverse = 0.63661977236758134308F, kRounds = 12582912.0F, kMost = 1e5F;
  static constexpr float kHigh = 1.57079637050628662109F, kMiddle = -4.37113900018624283e-8F,
                         kLow = -1.71512451306180e-15F;
};

/// Adds `count` terms of a polynomial, the last one first.
template <class Real, int kCount>
STICTION_HD Real polynomial(const Scalar<Real> (&term)[kCount], Real x) {
  Real sum(term[kCount - 1]);
  for (int k = kCount - 2; k >= 0; --k) sum = fma_(sum, x, Real(term[k]));
  return sum;
}

/// Sine and cosine of an angle [rad], to about an ulp; NaN beyond QuarterTurn::kMost. The polynomials on [-pi/4, pi/4]
/// are those of FreeBSD's msun (double, kernels of sine and cosine) and of S. L. Moshier's Cephes (single).
template <class Real>
STICTION_HD SineCosine<Real> sine_cosine(Real angle) {
  using T = Scalar<Real>;
  using Turn = QuarterTurn<T>;
  const auto nearest = [](Real x) { return (x + Real(Turn::kRounds)) - Real(Turn::kRounds); };
  const Real near = select(abs_(angle) <= Real(Turn::kMost), angle, Real(0));
  const Real turns = nearest(near * Real(Turn::kInverse));
  Real rest = fma_(-turns, Real(Turn::kHigh), near);
  rest = fma_(-turns, Real(Turn::kMiddle), rest);
  rest = fma_(-turns, Real(Turn::kLow), rest);
  const Real square = rest * rest;
  Real sine, cosine;
  if constexpr (sizeof(T) == sizeof(double)) {
    constexpr T kSine[] = {-1.66666666666666324348e-01, 8.33333333332248946124e-03,  -1.98412698298579493134e-04,
                           2.75573137070700676789e-06,  -2.50507602534068634195e-08, 1.58969099521155010221e-10};
    constexpr T kCosine[] = {4.16666666666666019037e-02,  -1.38888888888741095749e-03, 2.48015872894767294178e-05,
                             -2.75573143513906633035e-07, 2.08757232129817482790e-09,  -1.13596475577881948265e-11};
    sine = fma_(rest * square, polynomial<Real>(kSine, square), rest);
    cosine = fma_(square * square, polynomial<Real>(kCosine, square), fma_(Real(-0.5), square, Real(1)));
  } else {
    constexpr T kSine[] = {-1.6666654611e-1F, 8.3321608736e-3F, -1.9515295891e-4F};
    constexpr T kCosine[] = {4.166664568298827e-2F, -1.388731625493765e-3F, 2.443315711809948e-5F};
    sine = fma_(rest * square, polynomial<Real>(kSine, square), rest);
    cosine = fma_(square * square, polynomial<Real>(kCosine, square), fma_(Real(-0.5F), square, Real(1)));
  }
  // Quarter turns from -2 to 2: both ends are half a turn.
  const Real quarters = turns - Real(4) * nearest(turns * Real(T(0.25)));
  const auto is_odd = abs_(quarters) == Real(1);
  const Real first = select(is_odd, cosine, sine);
  const Real second = select(is_odd, sine, cosine);
  const auto is_sine_turned = or_(quarters<Real(0), quarters> Real(T(1.5)));
  const auto is_cosine_turned = or_(quarters > Real(T(0.5)), quarters < Real(T(-1.5)));
  const Real unknown = angle - near;  // zero, or NaN or as large as the angle
  const Real lost = select(unknown == Real(0), Real(0), Real(static_cast<T>(__builtin_nan(""))));
  return {select(is_sine_turned, -first, first) + lost, select(is_cosine_turned, -second, second) + lost};
}

}  // namespace stiction::inline STICTION_ISA
