#pragma once

#include "core/algorithm/collision/manifold.hpp"

/// Spheres and capsules against each other: segments with a radius.
namespace stiction::inline STICTION_ISA {

/// Square of the sine below which two directions count as parallel.
inline constexpr double kParallel = 1e-4;

/// A segment: centre - h to centre + h.
template <class T>
struct Segment {
  Vector3<T> centre, h;
};

template <class T>
STICTION_HD Vector3<T> point_at(const Segment<T>& segment, T t) {
  return add_scaled(segment.centre, t, segment.h);
}

/// Parameter in [-1, 1] of the point of a segment that is nearest to p; 0 of a segment without length.
template <class T>
STICTION_HD T nearest_on(const Segment<T>& segment, const Vector3<T>& p) {
  const T square = dot(segment.h, segment.h);
  if (!(square > T(0))) return T(0);
  return clamp_(div_(dot(segment.h, subtract(p, segment.centre)), square), T(-1), T(1));
}

/// Nearest points of two segments as parameters (Ericson, Real-Time Collision Detection, 2005, section 5.1.9, with the
/// parameter counted from the centre). Of parallel ones, a pair of nearest points near the first one's centre.
template <class T>
struct NearestPair {
  T s, t;
  bool parallel;  ///< both have a length, and the same direction
};

template <class T>
STICTION_HD_OUTLINE NearestPair<T> nearest_points(const Segment<T>& one, const Segment<T>& other) {
  const T a = dot(one.h, one.h);
  const T e = dot(other.h, other.h);
  const T b = dot(one.h, other.h);
  const Vector3<T> r = subtract(one.centre, other.centre);
  const T denominator = fma_(a, e, -(b * b));
  const bool both = a > T(0) && e > T(0);
  const bool crossed = both && denominator > T(kParallel) * (a * e);
  T s(0);
  if (crossed) s = clamp_(div_(b * dot(other.h, r) - dot(one.h, r) * e, denominator), T(-1), T(1));
  const T t = nearest_on(other, point_at(one, s));
  return {nearest_on(one, point_at(other, t)), t, both && !crossed};
}

/// The contact of two points with radii; where they coincide, along `otherwise`.
template <class T>
STICTION_HD ContactCandidate<T> between_points(const Vector3<T>& p, T radius_p, const Vector3<T>& q, T radius_q,
                                               const Vector3<T>& otherwise, Index feature) {
  const Vector3<T> gap = subtract(q, p);
  const T distance = length(gap);
  const Vector3<T> n =
      distance > T(0) ? Vector3<T>{div_(gap.x, distance), div_(gap.y, distance), div_(gap.z, distance)} : otherwise;
  const T depth = (radius_p + radius_q) - distance;
  return {add_scaled(p, fma_(T(-0.5), depth, radius_p), n), n, depth, feature};
}

/// A direction across both segments, for centre lines that cross in a point.
template <class T>
STICTION_HD Vector3<T> across(const Vector3<T>& a, const Vector3<T>& b) {
  const Vector3<T> c = cross(a, b);
  const T size = length(c);
  if (!(size > T(0))) return {T(0), T(0), T(1)};
  return {div_(c.x, size), div_(c.y, size), div_(c.z, size)};
}

/// One point where two round shapes are nearest; where capsules lie along each other, one at each end of the overlap.
template <class T>
STICTION_HD_OUTLINE Manifold<T> round_round(const PlacedShape<T>& a, const PlacedShape<T>& b, T margin) {
  Manifold<T> found;
  const Segment<T> one{a.centre, half_segment(a)};
  const Segment<T> other{b.centre, half_segment(b)};
  const NearestPair<T> nearest = nearest_points(one, other);
  const Vector3<T> otherwise = across(one.h, other.h);
  const auto add = [&](T s, T t, Index feature) {
    found.add(between_points(point_at(one, s), a.size[0], point_at(other, t), b.size[0], otherwise, feature), margin);
  };
  if (nearest.parallel) {
    const T square = dot(one.h, one.h);
    const T middle = div_(dot(one.h, subtract(other.centre, one.centre)), square);
    const T half = div_(abs_(dot(one.h, other.h)), square);
    const T low = max_(T(-1), middle - half);
    const T high = min_(T(1), middle + half);
    if (low < high) {
      add(low, nearest_on(other, point_at(one, low)), 0);
      add(high, nearest_on(other, point_at(one, high)), 1);
      return found;
    }
  }
  add(nearest.s, nearest.t, 0);
  return found;
}

}  // namespace stiction::inline STICTION_ISA
