#pragma once

#include "core/base/real.hpp"

/// Bounds of box rows as users give them.
namespace stiction::inline STICTION_ISA {

/// From here on a bound is infinite (docs/math/scaling.md).
inline constexpr double kLeastInfinity = 1e20;
/// A bound as the law has it: +-infinity from kLeastInfinity on.
template <class Real>
STICTION_HD Real lower_or_none(Real lo) {
  return lo <= static_cast<Real>(-kLeastInfinity) ? Real(0) - static_cast<Real>(__builtin_huge_valf()) : lo;
}
template <class Real>
STICTION_HD Real upper_or_none(Real hi) {
  return hi >= static_cast<Real>(kLeastInfinity) ? static_cast<Real>(__builtin_huge_valf()) : hi;
}

}  // namespace stiction::inline STICTION_ISA
