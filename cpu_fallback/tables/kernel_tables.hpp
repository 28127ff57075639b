#pragma once

#include <cstddef>
#include <type_traits>

#include "stiction/types.hpp"

namespace stiction::cpu {

/// The table of a precision, of a set that has one for each.
template <class Real, class Set>
[[nodiscard]] const auto& of_precision(const Set& set) {
  if constexpr (std::is_same_v<Real, float>) {
    return set.f32;
  } else {
    return set.f64;
  }
}

/// One table for each precision.
template <template <class> class Table>
struct ByPrecision {
  Table<float> f32;
  Table<double> f64;
};

/// One table for each precision and law.
template <template <class> class Table, int kLaws = 2>
struct ByPrecisionAndLaw {
  Table<float> f32[kLaws];   ///< by Law
  Table<double> f64[kLaws];  ///< by Law

  template <class Real>
  [[nodiscard]] const Table<Real>& of(Law law) const {
    return of_precision<Real>(*this)[static_cast<std::size_t>(law)];
  }
};

}  // namespace stiction::cpu
