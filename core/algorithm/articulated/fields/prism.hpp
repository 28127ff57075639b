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

template <class T>
STICTION_HD SurfacePoint<T> select(Mask<T> c, const SurfacePoint<T>& a, const SurfacePoint<T>& b) {
  return {select(c, a.at, b.at), select(c, a.normal, b.normal), select(c, a.distance, b.distance)};
}

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
  /// True for a point above, in or below it.
  [[nodiscard]] STICTION_HD Mask<T> is_level_with(const Vector3<T>& p) const {
    return and_(beyond(1, p) <= T(0), and_(beyond(2, p) <= T(0), beyond(3, p) <= T(0)));
  }
  /// The foot of a point on the plane of the face that it is farthest beyond, of equals the first.
  [[nodiscard]] STICTION_HD SurfacePoint<T> foot_on_outermost(const Vector3<T>& p) const {
    T most = beyond(0, p);
    Vector3<T> outer = normal[0];
    for (Index face = 1; face < kFaces; ++face) {
      const T own = beyond(face, p);
      outer = select(own > most, normal[face], outer);
      most = select(own > most, own, most);
    }
    return {add_scaled(p, -most, outer), outer, most};
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
  const SurfacePoint<T> foot = prism.foot_on_outermost(p);
  const auto is_outside = foot.distance > T(0);
  if (!any(is_outside)) return foot;
  Vector3<T> at = p;
  T least = T(__builtin_huge_valf());
  for (Index face = 0; face < prism.kFaces; ++face) {
    const auto looks_at = prism.beyond(face, p) > T(0);
    if (!any(looks_at)) continue;
    for (Index half = 0; half < (face % 4 == 0 ? 1 : 2); ++half) {
      const Vector3<T> found = nearest_in(prism.part(face, half), p);
      const Vector3<T> gap = subtract(p, found);
      const auto is_nearer = and_(looks_at, dot(gap, gap) < least);
      least = select(is_nearer, dot(gap, gap), least);
      at = select(is_nearer, found, at);
    }
  }
  return select(is_outside, {at, direction_of(subtract(p, at), foot.normal, T(0)), sqrt_(least)}, foot);
}

/// Two ends, and the segment between them.
template <class T>
struct Ends {
  Segment<T> axis;
  Vector3<T> at[2];

  STICTION_HD explicit Ends(const Segment<T>& segment)
      : axis(segment), at{point_at(segment, T(-1)), point_at(segment, T(1))} {}
};

/// True for a segment that no face parts from a prism by `most`.
template <class T>
STICTION_HD Mask<T> is_near(const FieldPrism<T>& prism, const Ends<T>& ends, T most) {
  auto near = T(0) == T(0);
  for (Index face = 0; face < prism.kFaces; ++face)
    near = and_(near, min_(prism.beyond(face, ends.at[0]), prism.beyond(face, ends.at[1])) < most);
  return near;
}

/// Returns true for a segment that is farther than `most` beyond the top of a prism or one of its sides. It needs
/// neither roots nor quotients, and does not see some that are a little farther.
template <class T>
STICTION_HD bool is_beyond(const Triangle3<T>& top, const Ends<T>& ends, T most) {
  const T far = T(1.001) * (most * most);
  const auto is_parted = [&](const Vector3<T>& n, const Vector3<T>& corner) {
    const T least = min_(dot(n, subtract(ends.at[0], corner)), dot(n, subtract(ends.at[1], corner)));
    return least > T(0) && least * least > far * dot(n, n);
  };
  const auto side = [](const Vector3<T>& from, const Vector3<T>& to) {
    return Vector3<T>{to.y - from.y, from.x - to.x, T(0)};
  };
  return is_parted(cross(subtract(top.b, top.a), subtract(top.c, top.a)), top.a) ||
         is_parted(side(top.a, top.b), top.a) || is_parted(side(top.b, top.c), top.b) ||
         is_parted(side(top.c, top.a), top.c);
}

/// True for a segment of which some point is in a prism.
template <class T>
STICTION_HD Mask<T> pierces(const Ends<T>& ends, const FieldPrism<T>& prism) {
  T low(0), high(1);
  auto is_apart = T(0) > T(0);
  for (Index face = 0; face < prism.kFaces; ++face) {
    const T first = prism.beyond(face, ends.at[0]), second = prism.beyond(face, ends.at[1]);
    const auto begins = first > T(0), ends_there = second > T(0);
    const T part = div_(first, first - second);
    low = select(begins, max_(low, part), low);
    high = select(ends_there, min_(high, part), high);
    is_apart = or_(is_apart, and_(begins, ends_there));
  }
  return and_(low <= high, not_(is_apart));
}

/// The point of a prism's edges that is nearest to a segment outside of it.
template <class T>
STICTION_HD_OUTLINE SurfacePoint<T> nearest_edge(const FieldPrism<T>& prism, const Segment<T>& axis) {
  using Number = Scalar<T>;
  T least = T(__builtin_huge_valf());
  Vector3<T> found = prism.corner[0], away{T(0), T(0), T(0)};
  for (Index e = 0; e < prism.kEdges; ++e) {
    const Segment<T> edge = prism.edge(e);
    const NearestPair<T> nearest =
        nearest_points(axis, edge, sizeof(Number) == sizeof(double) ? Number(1e-15) : Number(1e-9));
    const Vector3<T> at = point_at(edge, nearest.t), gap = subtract(point_at(axis, nearest.s), at);
    const auto is_nearer = dot(gap, gap) < least;
    least = select(is_nearer, dot(gap, gap), least);
    found = select(is_nearer, at, found);
    away = select(is_nearer, gap, away);
  }
  return {found, direction_of(away, prism.normal[0], T(0)), sqrt_(least)};
}

/// How a segment that pierces a prism gets out of it.
template <class T>
struct PrismExit {
  SurfacePoint<T> shortest;
  Mask<T> is_by_face;            ///< or across an edge
  Vector3<T> other;              ///< by a face: the segment's outer end
  SurfacePoint<T> out_of_other;  ///< its foot on the face
};

/// The shortest way out of a prism for a segment that pierces it, by a face. Across an edge it goes if that is shorter
/// by more than `nearer`.
template <class T>
STICTION_HD_OUTLINE PrismExit<T> way_out(const FieldPrism<T>& prism, const Ends<T>& ends, T nearer) {
  T most = -T(__builtin_huge_valf()), outer_most = most;
  Vector3<T> normal = prism.normal[0], inner = ends.at[0], outer = ends.at[1];
  for (Index f = 0; f < prism.kFaces; ++f) {
    const T first = prism.beyond(f, ends.at[0]), second = prism.beyond(f, ends.at[1]);
    const auto is_second = second < first;
    const T beyond = select(is_second, second, first);
    const auto is_shorter = beyond > most;
    most = select(is_shorter, beyond, most);
    outer_most = select(is_shorter, select(is_second, first, second), outer_most);
    normal = select(is_shorter, prism.normal[f], normal);
    inner = select(is_shorter, select(is_second, ends.at[1], ends.at[0]), inner);
    outer = select(is_shorter, select(is_second, ends.at[0], ends.at[1]), outer);
  }
  PrismExit<T> way{{add_scaled(inner, -most, normal), normal, most},
                   T(0) == T(0),
                   outer,
                   {add_scaled(outer, -outer_most, normal), normal, outer_most}};
  T least = most + nearer;
  for (Index e = 0; e < prism.kEdges; ++e) {
    const Segment<T> edge = prism.edge(e);
    const Vector3<T> across = cross(edge.h, ends.axis.h);
    const T square = dot(across, across);
    const auto is_across = square > T(1e-10) * (dot(edge.h, edge.h) * dot(ends.axis.h, ends.axis.h));
    for (int side = 1; side >= -1; side -= 2) {
      const Vector3<T> n = scaled(div_(T(side), sqrt_(select(is_across, square, T(1)))), across);
      const T beyond = dot(n, subtract(ends.axis.centre, edge.centre));
      const auto may_be = and_(is_across, beyond > least);
      if (!any(may_be)) continue;
      const auto is_shorter = and_(may_be, not_(prism.reach(n) > dot(n, edge.centre) + nearer));
      if (!any(is_shorter)) continue;
      const NearestPair<T> nearest = nearest_points(ends.axis, edge, Scalar<T>(0));
      way.shortest = select(is_shorter, {point_at(edge, nearest.t), n, beyond}, way.shortest);
      way.is_by_face = and_(way.is_by_face, not_(is_shorter));
      least = select(is_shorter, beyond, least);
    }
  }
  return way;
}

}  // namespace stiction::inline STICTION_ISA
