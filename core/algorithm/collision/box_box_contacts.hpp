#pragma once

#include "core/algorithm/collision/box_axes.hpp"
#include "core/algorithm/collision/face_polygon.hpp"

/// Two boxes: along the direction of least overlap, a face cut to the other's outline, or one point between two edges.
namespace stiction::inline STICTION_ISA {

/// The face of `box` that looks most against n, as a polygon in the coordinates of `frame`.
template <class T>
STICTION_HD_OUTLINE FacePolygon<T> facing(const PlacedShape<T>& box, const Vector3<T>& n, const Axes3<T>& frame,
                                          const Vector3<T>& origin) {
  Index m = 0;
  for (Index k = 1; k < 3; ++k)
    if (abs_(dot(axis(box.axes, k), n)) > abs_(dot(axis(box.axes, m), n))) m = k;
  const Index u = (m + 1) % 3;
  const Index v = (m + 2) % 3;
  const T side = -sign_of(dot(axis(box.axes, m), n));
  const Vector3<T> centre =
      components(frame, add_scaled(subtract(box.centre, origin), side * box.size[m], axis(box.axes, m)));
  const Vector3<T> along_u = scaled(box.size[u], components(frame, axis(box.axes, u)));
  const Vector3<T> along_v = scaled(box.size[v], components(frame, axis(box.axes, v)));
  FacePolygon<T> face;
  for (Index k = 0; k < 4; ++k)
    face.add(add_scaled(add_scaled(centre, k == 0 || k == 3 ? T(-1) : T(1), along_u), k < 2 ? T(-1) : T(1), along_v),
             k);
  return face;
}

/// Contacts of box `other` with the face of `box` whose outward normal is n, its axis `k`. Normals along n.
template <class T>
STICTION_HD_OUTLINE Manifold<T> on_face(const PlacedShape<T>& box, Index k, const Vector3<T>& n,
                                        const PlacedShape<T>& other, T margin) {
  const Index u = (k + 1) % 3;
  const Index v = (k + 2) % 3;
  const Axes3<T> frame{axis(box.axes, u), axis(box.axes, v), n};
  FacePolygon<T> polygon = facing(other, n, frame, box.centre);
  polygon = cut(polygon, 0, T(1), box.size[u], 4);
  polygon = cut(polygon, 1, T(1), box.size[v], 5);
  polygon = cut(polygon, 0, T(-1), box.size[u], 6);
  polygon = cut(polygon, 1, T(-1), box.size[v], 7);
  Manifold<T> found;
  const std::uint32_t kept = four_corners(polygon, box.size[k] + margin);
  for (Index corner = 0; corner < polygon.count; ++corner) {
    if ((kept >> corner & 1U) == 0) continue;
    const Vector3<T> at = polygon.corner[corner];
    const Vector3<T> halfway{at.x, at.y, T(0.5) * (at.z + box.size[k])};
    found.add({added(box.centre, along(frame, halfway)), n, box.size[k] - at.z, polygon.feature(corner)}, margin);
  }
  return found;
}

/// The edge along axis k that lies farthest in a direction.
template <class T>
STICTION_HD Segment<T> outermost_edge(const PlacedShape<T>& box, Index k, const Vector3<T>& direction) {
  const auto step = [&](Index j) { return j == k ? T(0) : sign_of(dot(axis(box.axes, j), direction)) * box.size[j]; };
  return {added(box.centre, along(box.axes, Vector3<T>{step(0), step(1), step(2)})),
          scaled(box.size[k], axis(box.axes, k))};
}

/// Features ascending: at most four, by insertion.
template <class T>
STICTION_HD void sort_features(Manifold<T>& found) {
  for (Index k = 1; k < found.count; ++k)
    for (Index j = k; j > 0 && found.at[j].feature < found.at[j - 1].feature; --j) {
      const ContactCandidate<T> swapped = found.at[j];
      found.at[j] = found.at[j - 1];
      found.at[j - 1] = swapped;
    }
}

/// If the boxes do not meet, `depth` is minus the gap along that direction: at least minus their distance. The feature
/// is 0 of two edges, else the two sides that meet in the point.
template <class T>
STICTION_HD_OUTLINE Manifold<T> box_box(const PlacedShape<T>& a, const PlacedShape<T>& b, T margin) {
  Manifold<T> found;
  const BoxAxis<T> least = least_overlap(a, b);
  if (least.gap > margin) return found;
  if (least.is_edge()) {
    const Segment<T> one = outermost_edge(a, least.of_a, least.normal);
    const Segment<T> other = outermost_edge(b, least.of_b, scaled(T(-1), least.normal));
    const NearestPair<T> nearest = nearest_points(one, other);
    const Vector3<T> middle = scaled(T(0.5), added(point_at(one, nearest.s), point_at(other, nearest.t)));
    found.add({middle, least.normal, -least.gap, 0}, margin);
    return found;
  }
  if (least.of_a >= 0) {
    found = on_face(a, least.of_a, least.normal, b, margin);
  } else {
    found = on_face(b, least.of_b, scaled(T(-1), least.normal), a, margin);
    found.swap_sides();
  }
  sort_features(found);
  return found;
}

}  // namespace stiction::inline STICTION_ISA
