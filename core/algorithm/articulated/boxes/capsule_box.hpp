#pragma once

#include "core/algorithm/articulated/boxes/sphere_box.hpp"
#include "core/algorithm/collision/box_round_contacts.hpp"

namespace stiction::inline STICTION_ISA {

/// A capsule's segment in the axes of a box.
template <class T>
struct CapsuleInBox : SegmentInBox<T> {
  T length;  ///< half of the segment's

  [[nodiscard]] STICTION_HD Triple<T> point(T t) const { return {{this->at(0, t), this->at(1, t), this->at(2, t)}}; }
  /// Bit k: the segment points along axis k.
  [[nodiscard]] STICTION_HD unsigned signs() const {
    return (this->h[0] > T(0) ? 1U : 0U) | (this->h[1] > T(0) ? 2U : 0U) | (this->h[2] > T(0) ? 4U : 0U);
  }
  /// Width of a box along an axis, in units of the segment's half length.
  [[nodiscard]] STICTION_HD T width(Index k) const { return div_(T(2) * this->e[k], abs_(this->h[k])); }
};

/// Parts of a box: `edge` is the middle of one, without its corners.
enum class BoxPart : std::uint8_t { none, inside, face, edge, corner };

/// The point of a segment that is nearest to a box, and to which part of it.
template <class T>
struct NearestPart {
  BoxPart part = BoxPart::none;
  T t{};                ///< of the segment
  T square{};           ///< of the distance
  Index axis = 0;       ///< of the face's normal, or of the edge
  unsigned corner = 0;  ///< bit k: at the upper side of axis k
  T along{};            ///< of an edge, in [-1, 1]
};

/// An end of the segment over or in the box: over one face at most.
template <class T>
STICTION_HD void consider_end(const CapsuleInBox<T>& segment, T t, NearestPart<T>& best) {
  T square(0);
  Index beyond = 0, axis = 0;
  for (Index k = 0; k < 3; ++k) {
    const T over = segment.beyond(k, t);
    if (over == T(0)) continue;
    ++beyond;
    axis = k;
    square = fma_(over, over, square);
  }
  if (beyond > 1 || !(square < best.square)) return;
  best = {beyond == 0 ? BoxPart::inside : BoxPart::face, t, square, axis, 0, T(0)};
}

/// The edge along axis j whose other sides are those of `corner`. Once its nearest point was clamped to a corner it
/// counts as one, though an end of the segment moves it away again. Second points follow from that.
template <class T>
STICTION_HD void consider_edge(const CapsuleInBox<T>& segment, Index j, unsigned corner, NearestPart<T>& best) {
  constexpr T kNearer = sizeof(T) == sizeof(double) ? T(kLeastValue) : T(1e-9);
  const Index u = (j + 1) % 3, v = (j + 2) % 3;
  const auto place = [&](Index k) { return (corner >> k & 1U) != 0 ? segment.e[k] : -segment.e[k]; };
  const T size = segment.e[j], h_j = segment.h[j], h_u = segment.h[u], h_v = segment.h[v];
  const T to_u = place(u) - segment.c[u], to_v = place(v) - segment.c[v];
  const T across = fma_(h_u, h_u, h_v * h_v), towards = fma_(h_u, to_u, h_v * to_v);
  if (!((size * size) * across >= T(kLeastValue))) return;
  T t = div_(towards, across);
  T x = div_(segment.at(j, t), size);
  int side = 0;
  const auto clamp = [&] {
    if (!(abs_(x) > T(1))) return false;
    side = x > T(1) ? 1 : -1;
    x = static_cast<T>(side);
    return true;
  };
  if (clamp()) t = div_(fma_(h_j, x * size - segment.c[j], towards), segment.length * segment.length);
  if (abs_(t) > T(1)) {
    t = t > T(1) ? T(1) : T(-1);
    x = div_(segment.at(j, t), size);
    clamp();
  }
  const T d_j = fma_(x, size, -segment.at(j, t)), d_u = fma_(-t, h_u, to_u), d_v = fma_(-t, h_v, to_v);
  const T square = fma_(d_j, d_j, fma_(d_u, d_u, d_v * d_v));
  if (!(square < best.square - kNearer)) return;
  best = {side == 0 ? BoxPart::edge : BoxPart::corner, t, square, j, corner | (side > 0 ? 1U << j : 0U), x};
}

template <class T>
STICTION_HD_OUTLINE NearestPart<T> nearest_part(const CapsuleInBox<T>& segment, T bound) {
  NearestPart<T> best;
  best.square = bound;
  consider_end(segment, T(-1), best);
  consider_end(segment, T(1), best);
  for (Index j = 0; j < 3; ++j)
    for (unsigned corner = 0; corner < 8; ++corner)
      if ((corner >> j & 1U) == 0) consider_edge(segment, j, corner, best);
  return best;
}

/// The axis whose bit alone is set, or -1.
STICTION_HD Index only_axis(unsigned bits) {
  return bits == 1 ? 0 : bits == 2 ? 1 : bits == 4 ? 2 : -1;
}

/// Finds how far from a corner, along the segment, a second point is. It is over the edge that the segment is within 45
/// degrees of, else over a face. Returns false if there is none.
template <class T>
STICTION_HD bool go_from_corner(const CapsuleInBox<T>& segment, const NearestPart<T>& nearest, T& beyond) {
  const unsigned away = segment.signs() ^ nearest.corner;
  const bool is_turned = only_axis(away) < 0;
  const Index k = only_axis(is_turned ? 7U - away : away);
  if (k < 0) return false;
  const T sign(is_turned ? T(-1) : T(1));
  const T cosine = div_(segment.h[k], segment.length);
  const T ahead = T(1) - sign * nearest.t, behind = T(1) + sign * nearest.t;
  beyond = cosine * cosine > T(0.5)
               ? sign * min_(segment.width(k), ahead)
               : -sign * min_(segment.width((k + 2) % 3), min_(segment.width((k + 1) % 3), behind));
  return true;
}

/// Finds a second point from the middle of an edge: over the face that the segment is more along.
template <class T>
STICTION_HD bool go_from_edge(const CapsuleInBox<T>& segment, const NearestPart<T>& nearest, T& beyond) {
  const Index j = nearest.axis, u = (j + 1) % 3, v = (j + 2) % 3;
  const unsigned away = (segment.signs() ^ nearest.corner) & ~(1U << j);
  if (only_axis(away) < 0) return false;
  const Index k = abs_(segment.h[u]) > abs_(segment.h[v]) ? u : v;
  const bool is_up = (away >> k & 1U) != 0;
  const T sign(is_up ? T(1) : T(-1));
  const bool is_same = ((segment.signs() >> j & 1U) != 0) == is_up;
  const T rest = segment.e[j] * (is_same ? T(1) - nearest.along : T(1) + nearest.along);
  const T over_edge = div_(rest, abs_(segment.h[j]));
  beyond = sign * min_(over_edge, min_(segment.width(k), T(1) - sign * nearest.t));
  return true;
}

/// Finds a second point from an end over a face: as far as the segment is over it.
template <class T>
STICTION_HD bool go_from_end(const CapsuleInBox<T>& segment, const NearestPart<T>& nearest, T& beyond) {
  const T sign = -nearest.t;
  T far(2);
  for (Index k = 0; k < 3; ++k) {
    if (k == nearest.axis) continue;
    for (int side = 1; side >= -1; side -= 2) {
      const T to_side = static_cast<T>(side) * segment.e[k] - segment.at(k, nearest.t);
      const T there = sign * div_(to_side, segment.h[k]);
      if (there > T(0) && there < far) far = there;
    }
  }
  beyond = sign * far;
  return true;
}

template <class T>
STICTION_HD bool go_on(const CapsuleInBox<T>& segment, const NearestPart<T>& nearest, T& beyond) {
  if (nearest.part == BoxPart::corner) return go_from_corner(segment, nearest, beyond);
  if (nearest.part == BoxPart::edge) return go_from_edge(segment, nearest, beyond);
  return nearest.part == BoxPart::face && go_from_end(segment, nearest, beyond);
}

/// A point where the segment is nearest, and one where it is still over the part that it is nearest to.
template <class T>
STICTION_HD_OUTLINE BoxPoints<T> capsule_box(const PlacedShape<T>& capsule, const PlacedShape<T>& box, T reach) {
  BoxPoints<T> found;
  const Vector3<T> centre = components(box.axes, subtract(capsule.centre, box.centre));
  const Vector3<T> half = components(box.axes, half_segment(capsule));
  const T radius = capsule.size[0], length = capsule.size[1];
  const CapsuleInBox<T> segment{
      {{centre.x, centre.y, centre.z}, {half.x, half.y, half.z}, {box.size[0], box.size[1], box.size[2]}}, length};
  const T extent = (radius + length) + (box.size[0] + (box.size[1] + box.size[2]));
  const NearestPart<T> nearest = nearest_part(segment, fma_(T(2), extent, reach));
  if (nearest.part == BoxPart::none) return found;
  touch_sphere(box, segment.point(nearest.t), radius, found);
  T beyond(0);
  if (go_on(segment, nearest, beyond)) touch_sphere(box, segment.point(nearest.t + beyond), radius, found);
  return found;
}

}  // namespace stiction::inline STICTION_ISA
