#pragma once

#include "core/algorithm/collision/round_contacts.hpp"

/// Finds the direction in which two boxes overlap least, among the fifteen that can separate them: the faces' normals,
/// and across an edge of each. (Gottschalk et al., OBBTree, SIGGRAPH 1996.)
namespace stiction::inline STICTION_ISA {

/// An edge's direction is taken only if it separates by that share of the smallest half extent more than a face's. The
/// second box's face is taken only if it separates by that more than the first's. Boxes that lie on each other thus
/// keep their contacts' names while they rock.
inline constexpr double kAxisBias = 0.01;

template <class T>
struct BoxAxis {
  Vector3<T> normal;  ///< unit, from the first box to the second
  T gap;              ///< negative: an overlap
  Index of_a, of_b;   ///< axis whose face or edge it is; -1: the other box's face
  STICTION_HD bool is_edge() const { return of_a >= 0 && of_b >= 0; }
};

/// Half the width of a box along a direction.
template <class T>
STICTION_HD T half_width(const PlacedShape<T>& box, const Vector3<T>& n) {
  return fma_(box.size[2], abs_(dot(box.axes.z, n)),
              fma_(box.size[1], abs_(dot(box.axes.y, n)), box.size[0] * abs_(dot(box.axes.x, n))));
}

template <class T>
STICTION_HD_OUTLINE BoxAxis<T> least_overlap(const PlacedShape<T>& a, const PlacedShape<T>& b) {
  const Vector3<T> apart = subtract(b.centre, a.centre);
  BoxAxis<T> best{{T(0), T(0), T(1)}, T(0), -1, -1};
  bool is_first = true;
  const auto consider = [&](const Vector3<T>& n, Index of_a, Index of_b) {
    const T centre = dot(n, apart);
    const T gap = (abs_(centre) - half_width(a, n)) - half_width(b, n);
    if (!is_first && !(gap > best.gap)) return;
    best = {scaled(sign_of(centre), n), gap, of_a, of_b};
    is_first = false;
  };
  const T smallest = min_(min_(min_(a.size[0], a.size[1]), a.size[2]), min_(min_(b.size[0], b.size[1]), b.size[2]));
  for (Index i = 0; i < 3; ++i) consider(axis(a.axes, i), i, -1);
  // Each group against the best of those before it, with the bias once.
  const auto consider_group = [&](auto&& each) {
    const BoxAxis<T> before = best;
    is_first = true;
    each();
    if (is_first || !(best.gap > before.gap + T(kAxisBias) * smallest)) best = before;
    is_first = false;
  };
  consider_group([&] {
    for (Index j = 0; j < 3; ++j) consider(axis(b.axes, j), -1, j);
  });
  consider_group([&] {
    for (Index i = 0; i < 3; ++i)
      for (Index j = 0; j < 3; ++j) {
        const Vector3<T> n = cross(axis(a.axes, i), axis(b.axes, j));
        const T square = dot(n, n);
        if (!(square > T(kParallel))) continue;
        consider(scaled(div_(T(1), sqrt_(square)), n), i, j);
      }
  });
  return best;
}

}  // namespace stiction::inline STICTION_ISA
