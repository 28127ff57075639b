#pragma once

#include "core/algorithm/collision/round_contacts.hpp"
#include "core/algorithm/collision/triangle.hpp"

/// Prisms that a height field is made of, and how far points and segments are from them.
namespace stiction::inline STICTION_ISA {

/// A point of a surface, the direction out of it, and how far something is that way: below 0 inside.
template <class T>
struct SurfacePoint {
  Vector3<T> at, normal;
  T distance;
};

/// A triangle with all below it down to a flat bottom, convex. Corners go counter-clockwise, seen from above.
template <class T>
struct FieldPrism {
  static constexpr Index kFaces = 5;  ///< the top, three sides, the bottom
  static constexpr Index kEdges = 9;  ///< of the top, upright ones, of the bottom
  Vector3<T> corner[6];               ///< of the top, then those below them
  Vector3<T> normal[kFaces];          ///< out of it

  STICTION_HD FieldPrism(const Triangle3<T>& top, T bottom) : corner{top.a, top.b, top.c} {
    const Vector3<T> up{T(0), T(0), T(1)};
    normal[0] = direction_of(cross(subtract(top.b, top.a), subtract(top.c, top.a)), up, T(0));
    for (Index k = 0; k < 3; ++k) {
      const Vector3<T> edge = subtract(corner[(k + 1) % 3], corner[k]);
      normal[1 + k] = direction_of(Vector3<T>{edge.y, -edge.x, T(0)}, up, T(0));
      corner[3 + k] = {corner[k].x, corner[k].y, bottom};
    }
    normal[4] = {T(0), T(0), T(-1)};
  }

  /// How far a point is beyond the plane of a face.
  [[nodiscard]] STICTION_HD T beyond(Index face, const Vector3<T>& p) const {
    const Index k = face == 0 ? 0 : face - 1;
    return dot(normal[face], subtract(p, corner[k]));
  }
  /// Returns true for a point above, in or below it.
  [[nodiscard]] STICTION_HD bool is_level_with(const Vector3<T>& p) const {
    return beyond(1, p) <= T(0) && beyond(2, p) <= T(0) && beyond(3, p) <= T(0);
  }
  /// The face whose plane a point is farthest beyond, of equals the first.
  [[nodiscard]] STICTION_HD Index outermost_face(const Vector3<T>& p) const {
    Index found = 0;
    for (Index face = 1; face < kFaces; ++face)
      if (beyond(face, p) > beyond(found, p)) found = face;
    return found;
  }
  /// Triangles that a face is made of: two of a side.
  [[nodiscard]] STICTION_HD Triangle3<T> part(Index face, Index half) const {
    if (face == 0) return {corner[0], corner[1], corner[2]};
    if (face == 4) return {corner[3], corner[4], corner[5]};
    const Index k = face - 1, next = face % 3;
    if (half == 0) return {corner[k], corner[3 + k], corner[next]};
    return {corner[3 + k], corner[3 + next], corner[next]};
  }
  [[nodiscard]] STICTION_HD Segment<T> edge(Index e) const {
    const Index k = e % 3, next = (k + 1) % 3;
    const Vector3<T>& from = corner[e < 6 ? k : 3 + k];
    const Vector3<T>& to = corner[e < 3 ? next : e < 6 ? 3 + k : 3 + next];
    const Vector3<T> half = scaled(T(0.5), subtract(to, from));
    return {added(from, half), half};
  }
  /// How far it reaches along a direction.
  [[nodiscard]] STICTION_HD T reach(const Vector3<T>& n) const {
    T most = dot(n, corner[0]);
    for (Index k = 1; k < 6; ++k) most = max_(most, dot(n, corner[k]));
    return most;
  }
};

/// The point of a prism's surface that is nearest to p. From inside that is the way out by the nearest face.
template <class T>
STICTION_HD_OUTLINE SurfacePoint<T> nearest_surface(const FieldPrism<T>& prism, const Vector3<T>& p) {
  const Index outer = prism.outermost_face(p);
  const T beyond = prism.beyond(outer, p);
  if (!(beyond > T(0))) return {add_scaled(p, -beyond, prism.normal[outer]), prism.normal[outer], beyond};
  Vector3<T> at = p;
  T least = static_cast<T>(__builtin_huge_valf());
  for (Index face = 0; face < prism.kFaces; ++face) {
    if (!(prism.beyond(face, p) > T(0))) continue;  // it looks away
    for (Index half = 0; half < (face % 4 == 0 ? 1 : 2); ++half) {
      const Vector3<T> found = nearest_in(prism.part(face, half), p);
      const Vector3<T> gap = subtract(p, found);
      if (!(dot(gap, gap) < least)) continue;
      least = dot(gap, gap);
      at = found;
    }
  }
  return {at, direction_of(subtract(p, at), prism.normal[outer], T(0)), sqrt_(least)};
}

/// Two ends, and the segment between them.
template <class T>
struct Ends {
  Segment<T> axis;
  Vector3<T> at[2];

  STICTION_HD explicit Ends(const Segment<T>& segment)
      : axis(segment), at{point_at(segment, T(-1)), point_at(segment, T(1))} {}
};

/// Returns true for a segment of which some point is in a prism.
template <class T>
STICTION_HD bool pierces(const Ends<T>& ends, const FieldPrism<T>& prism) {
  T low(0), high(1);
  for (Index face = 0; face < prism.kFaces; ++face) {
    const T first = prism.beyond(face, ends.at[0]), second = prism.beyond(face, ends.at[1]);
    if (first > T(0) && second > T(0)) return false;
    if (first > T(0)) low = max_(low, div_(first, first - second));
    if (second > T(0)) high = min_(high, div_(first, first - second));
  }
  return low <= high;
}

/// The point of a prism's edges that is nearest to a segment outside of it.
template <class T>
STICTION_HD_OUTLINE SurfacePoint<T> nearest_edge(const FieldPrism<T>& prism, const Segment<T>& axis) {
  SurfacePoint<T> best{{}, {}, static_cast<T>(__builtin_huge_valf())};
  Vector3<T> away{};
  for (Index e = 0; e < prism.kEdges; ++e) {
    const Segment<T> edge = prism.edge(e);
    const NearestPair<T> nearest = nearest_points(axis, edge, sizeof(T) == sizeof(double) ? T(1e-15) : T(1e-9));
    const Vector3<T> at = point_at(edge, nearest.t), gap = subtract(point_at(axis, nearest.s), at);
    if (!(dot(gap, gap) < best.distance)) continue;
    best = {at, {}, dot(gap, gap)};
    away = gap;
  }
  best.normal = direction_of(away, prism.normal[0], T(0));
  best.distance = sqrt_(best.distance);
  return best;
}

/// The shortest way out of a prism for a segment that pierces it, by a `face`. Across an edge, -1, it goes if that is
/// shorter by more than `nearer`.
template <class T>
STICTION_HD_OUTLINE SurfacePoint<T> way_out(const FieldPrism<T>& prism, const Ends<T>& ends, T nearer, Index& face) {
  SurfacePoint<T> best{{}, {}, -static_cast<T>(__builtin_huge_valf())};
  for (Index f = 0; f < prism.kFaces; ++f) {
    const T first = prism.beyond(f, ends.at[0]), second = prism.beyond(f, ends.at[1]);
    const T beyond = min_(first, second);
    if (!(beyond > best.distance)) continue;
    const Vector3<T>& inner = second < first ? ends.at[1] : ends.at[0];
    best = {add_scaled(inner, -beyond, prism.normal[f]), prism.normal[f], beyond};
    face = f;
  }
  T least = best.distance + nearer;
  for (Index e = 0; e < prism.kEdges; ++e) {
    const Segment<T> edge = prism.edge(e);
    const Vector3<T> across = cross(edge.h, ends.axis.h);
    const T square = dot(across, across);
    if (!(square > T(1e-10) * (dot(edge.h, edge.h) * dot(ends.axis.h, ends.axis.h)))) continue;
    for (int side = 1; side >= -1; side -= 2) {
      const Vector3<T> n = scaled(div_(static_cast<T>(side), sqrt_(square)), across);
      const T beyond = dot(n, subtract(ends.axis.centre, edge.centre));
      const bool is_outermost = !(prism.reach(n) > dot(n, edge.centre) + nearer);
      if (!(beyond > least) || !is_outermost) continue;
      const NearestPair<T> nearest = nearest_points(ends.axis, edge, T(0));
      best = {point_at(edge, nearest.t), n, beyond};
      least = beyond;
      face = -1;
    }
  }
  return best;
}

}  // namespace stiction::inline STICTION_ISA
