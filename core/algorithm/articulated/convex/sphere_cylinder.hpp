#pragma once

#include "core/algorithm/articulated/convex/convex_shape.hpp"

namespace stiction::inline STICTION_ISA {

/// Nearest points of a sphere's centre and a cylinder. From inside the centre leaves by the cap or the side, whichever
/// is nearer.
template <class T>
STICTION_HD_OUTLINE void leave_cylinder(const ConvexShape<T>& sphere, const ConvexShape<T>& cylinder,
                                        Closest<T>& found) {
  const T radius = cylinder.geom.size[0], half = cylinder.geom.size[1];
  const Vector3<T> own = components(cylinder.axes, subtract(sphere.centre, cylinder.centre));
  const T ring = sqrt_(fma_(own.x, own.x, own.y * own.y)), rise = abs_(own.z);
  const Vector3<T> side = direction_of(Vector3<T>{own.x, own.y, T(0)}, Vector3<T>{T(1), T(0), T(0)}, T(0));
  const Vector3<T> cap{T(0), T(0), sign_of(own.z)};
  const T beyond_side = ring - radius, beyond_cap = rise - half;
  const bool by_side = beyond_side > T(0) || beyond_side > beyond_cap;
  const bool by_cap = beyond_cap > T(0) || !by_side;
  const Vector3<T> gap = add_scaled(scaled(by_side ? beyond_side : T(0), side), by_cap ? beyond_cap : T(0), cap);
  const bool is_inside = !(beyond_side > T(0)) && !(beyond_cap > T(0));
  const Vector3<T> out = is_inside ? (by_side ? side : cap) : direction_of(gap, cap, T(0));
  found.normal = scaled(T(-1), along(cylinder.axes, out));
  found.distance = is_inside ? max_(beyond_side, beyond_cap) : length(gap);
  found.a = sphere.centre;
  found.b = add_scaled(sphere.centre, found.distance, found.normal);
}

}  // namespace stiction::inline STICTION_ISA
