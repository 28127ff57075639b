#pragma once

#include "core/algorithm/collision/pose.hpp"

namespace stiction::inline STICTION_ISA {

/// Corners of a triangle that has an area.
template <class T>
struct Triangle3 {
  Vector3<T> a, b, c;
};

/// The point of a triangle that is nearest to p: a corner, or on an edge, or inside (Ericson, Real-Time Collision
/// Detection, 2005, section 5.1.5).
template <class T>
STICTION_HD_OUTLINE Vector3<T> nearest_in(const Triangle3<T>& triangle, const Vector3<T>& p) {
  const auto& [a, b, c] = triangle;
  const Vector3<T> ab = subtract(b, a), ac = subtract(c, a);
  const Vector3<T> from_a = subtract(p, a), from_b = subtract(p, b), from_c = subtract(p, c);
  const T ab_a = dot(ab, from_a), ac_a = dot(ac, from_a);
  if (ab_a <= T(0) && ac_a <= T(0)) return a;
  const T ab_b = dot(ab, from_b), ac_b = dot(ac, from_b);
  if (ab_b >= T(0) && ac_b <= ab_b) return b;
  const T over_c = fma_(ab_a, ac_b, -(ab_b * ac_a));  // below 0: beyond the edge opposite to c
  if (over_c <= T(0) && ab_a >= T(0) && ab_b <= T(0)) return add_scaled(a, div_(ab_a, ab_a - ab_b), ab);
  const T ab_c = dot(ab, from_c), ac_c = dot(ac, from_c);
  if (ac_c >= T(0) && ab_c <= ac_c) return c;
  const T over_b = fma_(ab_c, ac_a, -(ab_a * ac_c));
  if (over_b <= T(0) && ac_a >= T(0) && ac_c <= T(0)) return add_scaled(a, div_(ac_a, ac_a - ac_c), ac);
  const T over_a = fma_(ab_b, ac_c, -(ab_c * ac_b));
  const T to_c = ac_b - ab_b, to_b = ab_c - ac_c;
  if (over_a <= T(0) && to_c >= T(0) && to_b >= T(0)) return add_scaled(b, div_(to_c, to_c + to_b), subtract(c, b));
  const T all = (over_a + over_b) + over_c;
  return add_scaled(add_scaled(a, div_(over_b, all), ab), div_(over_c, all), ac);
}

}  // namespace stiction::inline STICTION_ISA
