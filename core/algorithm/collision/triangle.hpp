#pragma once

#include "core/algorithm/collision/pose.hpp"

namespace stiction::inline STICTION_ISA {

/// Corners of a triangle that has an area.
template <class T>
struct Triangle3 {
  Vector3<T> a, b, c;
};

template <class T>
STICTION_HD Vector3<T> select(Mask<T> c, const Vector3<T>& a, const Vector3<T>& b) {
  return {select(c, a.x, b.x), select(c, a.y, b.y), select(c, a.z, b.z)};
}

/// The point of a triangle that is nearest to p: a corner, or on an edge, or inside (Ericson, Real-Time Collision
/// Detection, 2005, section 5.1.5).
template <class T>
STICTION_HD_OUTLINE Vector3<T> nearest_in(const Triangle3<T>& triangle, const Vector3<T>& p) {
  const auto& [a, b, c] = triangle;
  const T zero(0);
  const Vector3<T> ab = subtract(b, a), ac = subtract(c, a);
  const Vector3<T> from_a = subtract(p, a), from_b = subtract(p, b), from_c = subtract(p, c);
  const T ab_a = dot(ab, from_a), ac_a = dot(ac, from_a);
  const T ab_b = dot(ab, from_b), ac_b = dot(ac, from_b);
  const T ab_c = dot(ab, from_c), ac_c = dot(ac, from_c);
  const T over_c = fma_(ab_a, ac_b, -(ab_b * ac_a));  // below 0: beyond the edge opposite to c
  const T over_b = fma_(ab_c, ac_a, -(ab_a * ac_c));
  const T over_a = fma_(ab_b, ac_c, -(ab_c * ac_b));
  const T all = (over_a + over_b) + over_c, to_c = ac_b - ab_b, to_b = ab_c - ac_c;

  // From a corner along an edge, and inside from there along another one.
  Vector3<T> from = a, edge = ab;
  T part = over_b, whole = all;
  const auto take_edge = [&](Mask<T> is_on, const Vector3<T>& corner, const Vector3<T>& own_edge, T own, T rest) {
    from = select(is_on, corner, from);
    edge = select(is_on, own_edge, edge);
    part = select(is_on, own, part);
    whole = select(is_on, own + rest, whole);
  };
  const auto on_ab = and_(over_c <= zero, and_(ab_a >= zero, ab_b <= zero));
  const auto on_ac = and_(over_b <= zero, and_(ac_a >= zero, ac_c <= zero));
  const auto on_bc = and_(over_a <= zero, and_(to_c >= zero, to_b >= zero));
  take_edge(on_bc, b, subtract(c, b), to_c, to_b);
  take_edge(on_ac, a, ac, ac_a, -ac_c);
  take_edge(on_ab, a, ab, ab_a, -ab_b);
  const Vector3<T> on_edge = add_scaled(from, div_(part, whole), edge);
  Vector3<T> found = select(or_(on_ab, or_(on_ac, on_bc)), on_edge, add_scaled(on_edge, div_(over_c, all), ac));

  const auto at_c = and_(ac_c >= zero, ab_c <= ac_c);
  found = select(and_(at_c, not_(on_ab)), c, found);
  found = select(and_(ab_b >= zero, ac_b <= ab_b), b, found);
  return select(and_(ab_a <= zero, ac_a <= zero), a, found);
}

}  // namespace stiction::inline STICTION_ISA
