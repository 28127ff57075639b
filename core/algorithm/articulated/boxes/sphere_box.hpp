#pragma once

#include "core/algorithm/collision/manifold.hpp"

/// Points at which boxes touch spheres, capsules and each other, as MuJoCo chooses them (MuJoCo documentation,
/// "Collision detection"): of one lane. Normals point from the pair's first shape to its second.
namespace stiction::inline STICTION_ISA {

/// MuJoCo's mjMINVAL: of lengths, and of squares of sines.
inline constexpr double kLeastValue = 1e-15;
/// Most points of a pair.
inline constexpr Index kBoxPoints = 8;

/// The points of a pair in one lane.
template <class T>
struct BoxPoints {
  ContactCandidate<T> at[kBoxPoints];
  Index count = 0;

  STICTION_HD void add(const Vector3<T>& point, const Vector3<T>& normal, T depth) {
    if (count == kBoxPoints) return;
    at[count] = {point, normal, depth, count};
    ++count;
  }
};

/// Three numbers with an index.
template <class T>
struct Triple {
  T at[3];

  static STICTION_HD Triple of(const Vector3<T>& v) { return {{v.x, v.y, v.z}}; }
  [[nodiscard]] STICTION_HD Vector3<T> vector() const { return {at[0], at[1], at[2]}; }
};

/// The point of a box that is nearest to p, all in the box's axes.
template <class T>
STICTION_HD Triple<T> nearest_in_box(const T (&size)[3], const Triple<T>& p) {
  return {{clamp_(p.at[0], -size[0], size[0]), clamp_(p.at[1], -size[1], size[1]), clamp_(p.at[2], -size[2], size[2])}};
}

/// Adds the point of a sphere with its centre at p, in the box's axes. From inside it leaves by the nearest face, of
/// equals by the first.
template <class T>
STICTION_HD_OUTLINE void touch_sphere(const PlacedShape<T>& box, const Triple<T>& p, T radius, BoxPoints<T>& found) {
  const Triple<T> surface = nearest_in_box(box.size, p);
  const Vector3<T> inward = subtract(surface.vector(), p.vector());
  const T distance = length(inward);
  if (distance > T(kLeastValue)) {
    const Vector3<T> n{div_(inward.x, distance), div_(inward.y, distance), div_(inward.z, distance)};
    const Vector3<T> middle = scaled(T(0.5), added(surface.vector(), add_scaled(p.vector(), radius, n)));
    found.add(added(box.centre, along(box.axes, middle)), along(box.axes, n), radius - distance);
    return;
  }
  Index nearest = 0;
  T sign(1), least = p.at[0] + box.size[0];
  for (Index face = 1; face < 6; ++face) {
    const Index k = face / 2;
    const T gap = face % 2 == 0 ? p.at[k] + box.size[k] : box.size[k] - p.at[k];
    if (!(gap < least)) continue;
    least = gap;
    nearest = k;
    sign = face % 2 == 0 ? T(1) : T(-1);
  }
  Triple<T> middle = p;
  middle.at[nearest] = fma_(sign, T(0.5) * (radius - least), middle.at[nearest]);
  found.add(added(box.centre, along(box.axes, middle.vector())), scaled(sign, axis(box.axes, nearest)), radius + least);
}

template <class T>
STICTION_HD BoxPoints<T> sphere_box(const PlacedShape<T>& sphere, const PlacedShape<T>& box) {
  BoxPoints<T> found;
  touch_sphere(box, Triple<T>::of(components(box.axes, subtract(sphere.centre, box.centre))), sphere.size[0], found);
  return found;
}

}  // namespace stiction::inline STICTION_ISA
