#pragma once

#include "core/algorithm/articulated/convex/manifold_points.hpp"
#include "core/algorithm/articulated/convex/penetration.hpp"
#include "core/algorithm/articulated/convex/sphere_cylinder.hpp"

/// Points of hulls and cylinders with all but planes and height fields.
namespace stiction::inline STICTION_ISA {

/// `extent`: a length that both shapes lie in, for roundings.
template <class T>
STICTION_HD_OUTLINE HullPoints<T> convex_points(const ConvexShape<T>& a, const ConvexShape<T>& b, T reach, T extent) {
  HullPoints<T> found;
  const T radius_a = a.radius(), radius_b = b.radius();
  Closest<T> closest{};
  if (a.is(GeomKind::sphere) && b.is(GeomKind::cylinder)) {
    leave_cylinder(a, b, closest);
  } else {
    ConvexPair<T> pair{a, b, extent};
    const Encounter encounter = separate(pair, max_(reach + (radius_a + radius_b), T(0)), closest);
    if (encounter == Encounter::apart) return found;
    if (encounter == Encounter::overlapping && !penetrate(pair, closest)) return found;
  }
  const T distance = closest.distance - (radius_a + radius_b);
  if (!(distance <= reach)) return found;
  if (!a.is(GeomKind::sphere)) touch_over_faces(a, b, closest, reach, found);
  if (found.count > 0) return found;
  const Vector3<T> on_a = add_scaled(closest.a, radius_a, closest.normal);
  const Vector3<T> on_b = add_scaled(closest.b, -radius_b, closest.normal);
  found.at[found.count++] = {scaled(T(0.5), added(on_a, on_b)), closest.normal, -distance, 0};
  return found;
}

/// One lane's shape, seen from a place.
template <class Real, int kStride>
STICTION_HD ConvexShape<Scalar<Real>> convex_in(const Robots<Real, kStride>& robots, Index g, int lane,
                                                const Vector3<Scalar<Real>>& from) {
  const Vector3<Scalar<Real>> centre = vector_in(robots.work.geom_position[g], lane);
  return {robots.model, robots.model.geom[g], subtract(centre, from), axes_in(robots, g, lane)};
}

template <class Real, int kStride, class T>
STICTION_HD void touch_convex_by_lane(const Robots<Real, kStride>& robots, const ArticulatedPairData<T>& pair,
                                      Mask<Real> near) {
  touch_by_lane(robots, pair, near, [&](int lane) {
    const Vector3<T> centre = vector_in(robots.work.geom_position[pair.geom_a], lane);
    HullPoints<T> found = convex_points(convex_in(robots, pair.geom_a, lane, centre),
                                        convex_in(robots, pair.geom_b, lane, centre), pair.reach, pair.bound);
    for (Index k = 0; k < found.count; ++k) found.at[k].point = added(centre, found.at[k].point);
    return found;
  });
}

}  // namespace stiction::inline STICTION_ISA
