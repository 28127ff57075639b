#pragma once

#include <type_traits>

#include "core/base/real.hpp"

/// Disjoint sets of numbers, by a forest with path halving (Tarjan, van Leeuwen 1984). `parent` gives a reference to
/// the parent of a number, which may be stored as a float; roots are the smallest numbers of their sets. One lane.
namespace stiction::inline STICTION_ISA {

template <class Parent>
STICTION_HD Index root_of(Parent&& parent, Index i) {
  while (static_cast<Index>(parent(i)) != i) {
    parent(i) = parent(static_cast<Index>(parent(i)));
    i = static_cast<Index>(parent(i));
  }
  return i;
}

/// Makes one set of those of a and b.
template <class Parent>
STICTION_HD void join_sets(Parent&& parent, Index a, Index b) {
  using Number = std::remove_cvref_t<decltype(parent(a))>;
  a = root_of(parent, a);
  b = root_of(parent, b);
  if (a != b) parent(a > b ? a : b) = static_cast<Number>(a > b ? b : a);
}

/// The scale of each number becomes the largest of its set.
template <class Scales, class Parent>
STICTION_HD void raise_to_sets(Index count, const Scales& scale, Parent&& parent) {
  for (Index i = 0; i < count; ++i) {
    auto& of_set = scale[root_of(parent, i)];
    of_set = max_(scale[i], of_set);
  }
  for (Index i = 0; i < count; ++i) scale[i] = scale[root_of(parent, i)];
}

}  // namespace stiction::inline STICTION_ISA
