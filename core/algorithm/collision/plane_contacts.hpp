#pragma once

#include "core/algorithm/collision/manifold.hpp"

/// A half space against everything else; its normal is its z axis.
namespace stiction::inline STICTION_ISA {

/// The point halfway between a plane and a surface `depth` below it, on the line through `p`, which is `height` above.
template <class T>
STICTION_HD ContactCandidate<T> on_plane(const Vector3<T>& n, const Vector3<T>& p, T height, T depth, Index feature) {
  return {add_scaled(p, -fma_(T(0.5), depth, height), n), n, depth, feature};
}

/// Corner k of a box from its centre, in its axes. Bits 0, 1, 2 of k are the signs of x, y, z.
template <class T, class S>
STICTION_HD Vector3<T> corner_of(const S (&size)[3], Index k) {
  return {T((k & 1) != 0 ? size[0] : -size[0]), T((k & 2) != 0 ? size[1] : -size[1]),
          T((k & 4) != 0 ? size[2] : -size[2])};
}

/// One point for a sphere, one under each end of a capsule.
template <class T>
STICTION_HD_OUTLINE Manifold<T> plane_round(const PlacedShape<T>& plane, const PlacedShape<T>& round, T margin) {
  Manifold<T> found;
  const Vector3<T> n = plane.axes.z;
  const Vector3<T> h = half_segment(round);
  const Index ends = round.kind == ShapeKind::capsule ? 2 : 1;
  for (Index k = 0; k < ends; ++k) {
    const Vector3<T> p = add_scaled(round.centre, k == 0 ? T(-1) : T(1), h);
    const T height = dot(n, subtract(p, plane.centre));
    found.add(on_plane(n, p, height, round.size[0] - height, k), margin);
  }
  return found;
}

/// The four deepest corners, the lower number first among equals.
template <class T>
STICTION_HD_OUTLINE Manifold<T> plane_box(const PlacedShape<T>& plane, const PlacedShape<T>& box, T margin) {
  Manifold<T> found;
  const Vector3<T> n = plane.axes.z;
  Vector3<T> corner[8];
  T height[8];
  for (Index k = 0; k < 8; ++k) {
    corner[k] = added(box.centre, along(box.axes, corner_of<T>(box.size, k)));
    height[k] = dot(n, subtract(corner[k], plane.centre));
  }
  for (Index k = 0; k < 8; ++k) {
    Index before = 0;
    for (Index other = 0; other < 8; ++other)
      before += height[other] < height[k] || (height[other] == height[k] && other < k) ? 1 : 0;
    if (before < kManifoldPoints) found.add(on_plane(n, corner[k], height[k], -height[k], k), margin);
  }
  return found;
}

}  // namespace stiction::inline STICTION_ISA
