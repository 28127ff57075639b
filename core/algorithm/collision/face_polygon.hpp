#pragma once

#include "core/algorithm/collision/manifold.hpp"

/// One box's face cut to the outline of another's, and four corners of it.
namespace stiction::inline STICTION_ISA {

/// A polygon over a face, in coordinates (u, v, height) of the box whose face it is. Corners and sides turn around
/// once. Side k goes from corner k to the next, and has a name. 0 to 3 are sides of the polygon that was cut, 4 to 7
/// the lines that cut it. A corner is named by the two sides that meet there.
template <class T, Index kCorners = 8>
struct FacePolygon {
  static constexpr Index kMost = kCorners;
  Vector3<T> corner[kMost];
  Index side[kMost];
  Index count = 0;

  STICTION_HD void add(const Vector3<T>& at, Index name) {
    corner[count] = at;
    side[count++] = name;
  }
  [[nodiscard]] STICTION_HD Index feature(Index k) const { return 8 * side[k == 0 ? count - 1 : k - 1] + side[k]; }
};

/// The part where beyond(corner) <= 0 (Sutherland and Hodgman 1974). A cut adds at most one corner. `from`: a corner of
/// the whole that is looked at first.
template <class T, Index kCorners, class F>
STICTION_HD FacePolygon<T, kCorners> cut_beyond(const FacePolygon<T, kCorners>& whole, F&& beyond, Index name,
                                                Index from = 0) {
  FacePolygon<T, kCorners> part;
  for (Index step = 0; step < whole.count; ++step) {
    const Index k = from + step < whole.count ? from + step : from + step - whole.count;
    const Index next = k + 1 == whole.count ? 0 : k + 1;
    const T here = beyond(whole.corner[k]);
    const T there = beyond(whole.corner[next]);
    const bool is_in = here <= T(0);
    if (is_in && part.count < kCorners) part.add(whole.corner[k], whole.side[k]);
    if (is_in == (there <= T(0)) || part.count == kCorners) continue;
    const T share = div_(here, here - there);
    const Vector3<T> crossing = add_scaled(whole.corner[k], share, subtract(whole.corner[next], whole.corner[k]));
    part.add(crossing, is_in ? name : whole.side[k]);
  }
  return part;
}

/// The part where sign * (u or v) <= limit.
template <class T>
STICTION_HD_OUTLINE FacePolygon<T> cut(const FacePolygon<T>& whole, Index coordinate, T sign, T limit, Index name) {
  return cut_beyond(
      whole, [&](const Vector3<T>& corner) { return fma_(sign, entry(corner, coordinate), -limit); }, name);
}

/// Returns the corners to keep, as bits. At or below `highest` they are the lowest, the one farthest from it, and the
/// two farthest on either side of their line. The first wins a tie.
template <class T>
STICTION_HD_OUTLINE std::uint32_t four_corners(const FacePolygon<T>& polygon, T highest) {
  std::uint32_t kept = 0;
  const auto best_of = [&](auto&& value, T least) {
    Index best = -1;
    for (Index k = 0; k < polygon.count; ++k) {
      if (!(polygon.corner[k].z <= highest) || (kept >> k & 1U) != 0 || !(value(k) > least)) continue;
      best = k;
      least = value(k);
    }
    if (best >= 0) kept |= 1U << best;
    return best;
  };
  const T nothing = -static_cast<T>(__builtin_huge_valf());
  const Index first = best_of([&](Index k) { return -polygon.corner[k].z; }, nothing);
  if (first < 0) return kept;
  const auto from_first = [&](Index k) { return subtract(polygon.corner[k], polygon.corner[first]); };
  const Index second = best_of(
      [&](Index k) {
        const Vector3<T> d = from_first(k);
        return fma_(d.x, d.x, d.y * d.y);
      },
      T(0));
  if (second < 0) return kept;
  const Vector3<T> line = from_first(second);
  const auto area = [&](Index k) {
    const Vector3<T> d = from_first(k);
    return fma_(line.x, d.y, -(line.y * d.x));
  };
  best_of(area, T(0));
  best_of([&](Index k) { return -area(k); }, T(0));
  return kept;
}

}  // namespace stiction::inline STICTION_ISA
