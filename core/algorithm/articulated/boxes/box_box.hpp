#pragma once

#include "core/algorithm/articulated/boxes/sphere_box.hpp"
#include "core/algorithm/collision/box_box_contacts.hpp"

namespace stiction::inline STICTION_ISA {

/// Roundings that choices between directions, edges and corners leave out.
template <class T>
struct BoxRounding {
  static constexpr bool kIsDouble = sizeof(T) == sizeof(double);
  static constexpr T kGap = kIsDouble ? T(1e-13) : T(1e-6);         ///< of a gap, over the sum of half extents
  static constexpr T kParallel = kIsDouble ? T(1e-16) : T(1e-7);    ///< of the square of a sine
  static constexpr T kAmbiguous = kIsDouble ? T(1e-9) : T(1e-5);    ///< of a cosine
  static constexpr T kSamePoint = kIsDouble ? T(1e-14) : T(1e-10);  ///< of the square of a distance, over a face's
};

/// Two boxes that could touch, and the largest gap that counts.
template <class T>
struct BoxPair {
  const PlacedShape<T>&a, &b;
  T reach;
  Vector3<T> apart;
  T slack;

  STICTION_HD BoxPair(const PlacedShape<T>& first, const PlacedShape<T>& second, T most)
      : a(first), b(second), reach(most), apart(subtract(b.centre, a.centre)) {
    const T extent = (a.size[0] + a.size[1] + a.size[2]) + (b.size[0] + b.size[1] + b.size[2]);
    slack = fma_(BoxRounding<T>::kGap, extent, reach);
  }

  /// The gap along a unit direction, which is turned from the first box to the second.
  [[nodiscard]] STICTION_HD BoxAxis<T> along(const Vector3<T>& n, Index of_a, Index of_b) const {
    const T centre = dot(n, apart);
    const T sign = sign_of(centre);
    return {scaled(sign, n), (abs_(centre) - half_width(a, n)) - half_width(b, n), of_a, of_b};
  }
  /// Across an edge of each; false where they are parallel.
  STICTION_HD bool across(Index i, Index j, BoxAxis<T>& found) const {
    const Vector3<T> n = cross(axis(a.axes, i), axis(b.axes, j));
    const T square = dot(n, n);
    if (!(square >= BoxRounding<T>::kParallel)) return false;
    found = along(scaled(div_(T(1), sqrt_(square)), n), i, j);
    return true;
  }
};

/// The direction in which two boxes are farthest apart, of fifteen. One across edges is taken only if it is better by a
/// millionth. If it is within 8 degrees of a face's, a twentieth. Returns false if a gap is too large.
template <class T>
STICTION_HD_OUTLINE bool choose_axis(const BoxPair<T>& pair, BoxAxis<T>& best) {
  best = pair.along(pair.a.axes.x, 0, -1);
  if (!(best.gap <= pair.slack)) return false;
  for (Index k = 1; k < 6; ++k) {
    const bool is_first = k < 3;
    const BoxAxis<T> found =
        is_first ? pair.along(axis(pair.a.axes, k), k, -1) : pair.along(axis(pair.b.axes, k - 3), -1, k - 3);
    if (!(found.gap <= pair.slack)) return false;
    if (found.gap > best.gap) best = found;
  }
  const BoxAxis<T> face = best;
  for (Index i = 0; i < 3; ++i)
    for (Index j = 0; j < 3; ++j) {
      BoxAxis<T> found{};
      if (!pair.across(i, j, found)) continue;
      if (!(found.gap <= pair.slack)) return false;
      if (fma_(T(-1e-6), abs_(found.gap), found.gap) > best.gap && found.gap > face.gap) best = found;
    }
  const bool is_same = best.is_edge() && abs_(dot(best.normal, face.normal)) > T(0.99);
  if (is_same && best.gap < fma_(T(0.05), abs_(face.gap), face.gap) + T(kLeastValue)) best = face;
  return true;
}

/// The point between the outermost edges of both boxes. An edge is on either side of an axis that is across the
/// direction; of these the nearest ones count.
template <class T>
STICTION_HD_OUTLINE void touch_edges(const BoxPair<T>& pair, const BoxAxis<T>& best, BoxPoints<T>& found) {
  const auto ambiguous = [&](const Axes3<T>& axes, Index k) {
    for (Index step = 1; step < 3; ++step)
      if (abs_(dot(axis(axes, (k + step) % 3), best.normal)) < BoxRounding<T>::kAmbiguous) return (k + step) % 3;
    return Index{-1};
  };
  const auto other_side = [](const PlacedShape<T>& box, Index k, Segment<T> edge) {
    const T sign = sign_of(dot(axis(box.axes, k), subtract(edge.centre, box.centre)));
    edge.centre = add_scaled(edge.centre, T(-2) * sign * box.size[k], axis(box.axes, k));
    return edge;
  };
  const Index of_a = ambiguous(pair.a.axes, best.of_a), of_b = ambiguous(pair.b.axes, best.of_b);
  const Segment<T> one = outermost_edge(pair.a, best.of_a, best.normal);
  const Segment<T> other = outermost_edge(pair.b, best.of_b, scaled(T(-1), best.normal));
  Vector3<T> from = one.centre, to = other.centre;
  T least = static_cast<T>(__builtin_huge_valf());
  for (Index side = 0; side < 4; ++side) {
    if ((side % 2 == 1 && of_a < 0) || (side / 2 == 1 && of_b < 0)) continue;
    const Segment<T> edge_a = side % 2 == 1 ? other_side(pair.a, of_a, one) : one;
    const Segment<T> edge_b = side / 2 == 1 ? other_side(pair.b, of_b, other) : other;
    const NearestPair<T> nearest = nearest_points(edge_a, edge_b, T(kLeastValue));
    const Vector3<T> p = point_at(edge_a, nearest.s), q = point_at(edge_b, nearest.t);
    const Vector3<T> gap = subtract(q, p);
    if (!(dot(gap, gap) < least)) continue;
    least = dot(gap, gap);
    from = p;
    to = q;
  }
  const T distance = dot(subtract(to, from), best.normal);
  if (distance <= pair.slack) found.add(scaled(T(0.5), added(from, to)), best.normal, -distance);
}

/// The corners of the face of `other` that looks against the k-th face of `box`, cut to its outline. `sign`: 1 if the
/// normal from the first box to the second points out of `box`.
template <class T>
STICTION_HD_OUTLINE void touch_face(const PlacedShape<T>& box, Index k, const Vector3<T>& out,
                                    const PlacedShape<T>& other, T reach, T sign, BoxPoints<T>& found) {
  const T size_u = box.size[(k + 1) % 3], size_v = box.size[(k + 2) % 3];
  const Axes3<T> frame{axis(box.axes, (k + 1) % 3), axis(box.axes, (k + 2) % 3), out};
  FacePolygon<T> polygon = facing(other, out, frame, box.centre);
  polygon = cut(polygon, 0, T(1), size_u, 4);
  polygon = cut(polygon, 0, T(-1), size_u, 5);
  polygon = cut(polygon, 1, T(1), size_v, 6);
  polygon = cut(polygon, 1, T(-1), size_v, 7);
  const T same = BoxRounding<T>::kSamePoint * fma_(size_u, size_u, size_v * size_v);
  Index kept[FacePolygon<T>::kMost];
  for (Index corner = 0; corner < polygon.count; ++corner) {
    const Vector3<T>& at = polygon.corner[corner];
    const T distance = at.z - box.size[k];
    bool is_new = distance <= reach;
    for (Index before = 0; before < found.count && is_new; ++before) {
      const Vector3<T> gap = subtract(at, polygon.corner[kept[before]]);
      is_new = !(fma_(gap.x, gap.x, gap.y * gap.y) < same);
    }
    if (!is_new) continue;
    kept[found.count] = corner;
    const Vector3<T> halfway{at.x, at.y, fma_(T(0.5), distance, box.size[k])};
    found.add(added(box.centre, along(frame, halfway)), scaled(sign, out), -distance);
  }
}

template <class T>
STICTION_HD_OUTLINE BoxPoints<T> touch_boxes(const PlacedShape<T>& a, const PlacedShape<T>& b, T reach) {
  BoxPoints<T> found;
  const BoxPair<T> pair(a, b, reach);
  BoxAxis<T> best{};
  if (!choose_axis(pair, best)) return found;
  if (best.is_edge()) {
    touch_edges(pair, best, found);
  } else if (best.of_a >= 0) {
    touch_face(a, best.of_a, best.normal, b, reach, T(1), found);
  } else {
    touch_face(b, best.of_b, scaled(T(-1), best.normal), a, reach, T(-1), found);
  }
  return found;
}

}  // namespace stiction::inline STICTION_ISA
