#pragma once

#include <cstddef>
#include <type_traits>

#include "stiction/types.hpp"

namespace stiction::cpu {

/// One table for each precision.
template <template <class> class Table>
struct ByPrecision {
  Table<float> f32;
  Table<double> f64;

  template <class Real>
  [[nodiscard]] const Table<Real>& of() const {
    if constexpr (std::is_same_v<Real, float>) {
      return f32;
    } else {
      return f64;
    }
  }
};

/// One table for each precision and law.
template <template <class> class Table>
struct ByPrecisionAndLaw {
  Table<float> f32[2];   ///< by Law
  Table<double> f64[2];  ///< by Law

  template <class Real>
  [[nodiscard]] const Table<Real>& of(Law law) const {
    const auto index = static_cast<std::size_t>(law);
    if constexpr (std::is_same_v<Real, float>) {
      return f32[index];
    } else {
      return f64[index];
    }
  }
};

}  // namespace stiction::cpu
