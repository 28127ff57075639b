#pragma once

#include <concepts>
#include <cstddef>
#include <type_traits>

namespace stiction {

/// A count, or a class of counts.
template <class T>
concept Count = std::integral<T> || std::is_enum_v<T>;

/// A place in an array, as the standard library's containers count.
template <std::integral T>
constexpr std::size_t at(T place) {
  return static_cast<std::size_t>(place);
}

/// The larger and the smaller of two counts. They are for counts only. Floating-point numbers are selected in
/// core/base/real.hpp, where NaN has one meaning. The library's minima and maxima, which take both, are kept out of
/// everything that holds a solver.
template <Count T>
constexpr T larger_of(T a, T b) {
  return a < b ? b : a;
}
template <Count T>
constexpr T smaller_of(T a, T b) {
  return b < a ? b : a;
}

/// The count nearest to `count` between `least` and `most`; `most` wins where they cross.
template <Count T>
constexpr T bounded(T count, T least, T most) {
  return smaller_of(larger_of(count, least), most);
}

}  // namespace stiction
