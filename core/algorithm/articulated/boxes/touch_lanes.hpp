#pragma once

#include "core/algorithm/articulated/boxes/box_box.hpp"
#include "core/algorithm/articulated/boxes/capsule_box.hpp"
#include "core/algorithm/articulated/touch_by_lane.hpp"

/// Points of boxes with all but planes and height fields.
namespace stiction::inline STICTION_ISA {

template <class T>
STICTION_HD BoxPoints<T> points_with_box(const PlacedShape<T>& a, const PlacedShape<T>& box, T reach) {
  if (a.kind == ShapeKind::box) return touch_boxes(a, box, reach);
  return a.kind == ShapeKind::capsule ? capsule_box(a, box, reach) : sphere_box(a, box);
}

template <class Real, int kStride, class T>
STICTION_HD void touch_box_by_lane(const Robots<Real, kStride>& robots, const ArticulatedPairData<T>& pair,
                                   Mask<Real> near) {
  touch_by_lane(robots, pair, near, [&](int lane) {
    return points_with_box(shape_in(robots, pair.geom_a, lane), shape_in(robots, pair.geom_b, lane), pair.reach);
  });
}

}  // namespace stiction::inline STICTION_ISA
