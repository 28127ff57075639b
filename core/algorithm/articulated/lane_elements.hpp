#pragma once

#include <type_traits>

#include "core/algorithm/velocity/lanes/lane_array.hpp"

/// Arrays of vectors and matrices, of which every lane has its own.
namespace stiction::inline STICTION_ISA {

/// Number n of element i is data[(i * kNumbers + n) * kApart]. Elements of a pack have the numbers of all its lanes,
/// and lie behind one another: kApart is 1. A lane of a GPU's warp has those of the other lanes between two of its own.
template <class Element, class Number, int kApart>
struct LaneElements {
  static constexpr int kNumberBytes = sizeof(Number), kNumbers = sizeof(Element) / kNumberBytes;
  static_assert(sizeof(Element) == kNumbers * kNumberBytes);
  Number* data = nullptr;

  /// A reference to a number; an element of several is read here and written by put().
  STICTION_HD decltype(auto) operator[](Index i) const {
    if constexpr (std::is_same_v<Element, Number>) {
      return static_cast<Number&>(data[i * kApart]);
    } else if constexpr (kApart == 1) {
      return static_cast<const Element&>(reinterpret_cast<const Element*>(data)[i]);
    } else {
      Element element;
      for (int n = 0; n < kNumbers; ++n) reinterpret_cast<Number*>(&element)[n] = data[(i * kNumbers + n) * kApart];
      return element;
    }
  }
  STICTION_HD void put(Index i, const Element& element) const {
    if constexpr (kApart == 1) {
      reinterpret_cast<Element*>(data)[i] = element;
    } else {
      for (int n = 0; n < kNumbers; ++n)
        data[(i * kNumbers + n) * kApart] = reinterpret_cast<const Number*>(&element)[n];
    }
  }
  [[nodiscard]] STICTION_HD LaneElements from(Index i) const { return {data + i * kNumbers * kApart}; }
  /// These numbers as elements of another kind.
  template <class Other>
  [[nodiscard]] STICTION_HD LaneElements<Other, Number, kApart> as() const {
    return {data};
  }
  /// These numbers as those of all lanes, which algorithms on trees take.
  [[nodiscard]] STICTION_HD auto numbers() const {
    return LaneArray<Number, kApart * RealTraits<Number>::kLanes>{reinterpret_cast<Scalar<Number>*>(data)};
  }
};

}  // namespace stiction::inline STICTION_ISA
