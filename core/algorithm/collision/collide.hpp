#pragma once

#include "core/algorithm/collision/box_box_contacts.hpp"
#include "core/algorithm/collision/box_round_contacts.hpp"
#include "core/algorithm/collision/plane_contacts.hpp"

namespace stiction::inline STICTION_ISA {

/// Contacts of two placed shapes, whatever they are. Two planes have none.
template <class T>
STICTION_HD_OUTLINE Manifold<T> collide(const PlacedShape<T>& a, const PlacedShape<T>& b, T margin) {
  Manifold<T> found;
  // The kinds ascend sphere, capsule, box, plane: each function takes the later kind first.
  const bool swapped = a.kind < b.kind;
  const PlacedShape<T>& first = swapped ? b : a;
  const PlacedShape<T>& second = swapped ? a : b;
  if (first.kind == ShapeKind::plane) {
    if (second.kind == ShapeKind::plane) return found;
    found = second.kind == ShapeKind::box ? plane_box(first, second, margin) : plane_round(first, second, margin);
  } else if (first.kind == ShapeKind::box) {
    found = second.kind == ShapeKind::box ? box_box(first, second, margin) : box_round(first, second, margin);
  } else {
    found = round_round(first, second, margin);
  }
  if (swapped) found.swap_sides();
  return found;
}

}  // namespace stiction::inline STICTION_ISA
