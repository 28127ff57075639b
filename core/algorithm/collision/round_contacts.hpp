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
  const auto has_length = square > T(0);
  const T t = div_(dot(segment.h, subtract(p, segment.centre)), select(has_length, square, T(1)));
  return select(has_length, clamp_(t, T(-1), T(1)), T(0));
}

/// Nearest points of two segments as parameters (Ericson, Real-Time Collision Detection, 2005, section 5.1.9, with the
/// parameter counted from the centre). Parallel ones have a pair of nearest points near the first one's centre.
template <class T>
struct NearestPair {
  T s, t;
  Mask<T> parallel;  ///< both have a length, and the same direction
};

/// `parallel`: the square of the sine below which directions are the same.
template <class T>
STICTION_HD_OUTLINE NearestPair<T> nearest_points(const Segment<T>& one, const Segment<T>& other,
                                                  Scalar<T> parallel = Scalar<T>(kParallel)) {
  const T a = dot(one.h, one.h);
  const T e = dot(other.h, other.h);
  const T b = dot(one.h, other.h);
  const Vector3<T> r = subtract(one.centre, other.centre);
  const T denominator = fma_(a, e, -(b * b));
  const auto both = and_(a > T(0), e > T(0));
  const auto crossed = and_(both, denominator > T(parallel) * (a * e));
  const T first = div_(b * dot(other.h, r) - dot(one.h, r) * e, select(crossed, denominator, T(1)));
  const T s = select(crossed, clamp_(first, T(-1), T(1)), T(0));
  const T t = nearest_on(other, point_at(one, s));
  return {nearest_on(one, point_at(other, t)), t, and_(both, not_(crossed))};
}

/// The contact of two points with radii; where they are no farther apart than `least`, along `otherwise`.
template <class T>
STICTION_HD ContactCandidate<T> between_points(const Vector3<T>& p, T radius_p, const Vector3<T>& q, T radius_q,
                                               const Vector3<T>& otherwise, Index feature, T least = T(0)) {
  const Vector3<T> gap = subtract(q, p);
  const Vector3<T> n = direction_of(gap, otherwise, least);
  const T depth = (radius_p + radius_q) - length(gap);
  return {add_scaled(p, fma_(T(-0.5), depth, radius_p), n), n, depth, feature};
}

/// One point where two round shapes are nearest; where capsules lie along each other, one at each end of the overlap.
template <class T>
STICTION_HD_OUTLINE Manifold<T> round_round(const PlacedShape<T>& a, const PlacedShape<T>& b, T margin) {
  Manifold<T> found;
  const Segment<T> one{a.centre, half_segment(a)};
  const Segment<T> other{b.centre, half_segment(b)};
  const NearestPair<T> nearest = nearest_points(one, other);
  // Across both, for centre lines that cross in a point.
  const Vector3<T> otherwise = direction_of(cross(one.h, other.h), Vector3<T>{T(0), T(0), T(1)}, T(0));
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
