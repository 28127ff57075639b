#pragma once

#include "core/algorithm/rigid/vector3.hpp"
#include "stiction/bodies.hpp"

/// One contact point between two bodies. It gives a row of J, a column of M^-1 J' and a block of J M^-1 J' when
/// nothing is stored but geometry (docs/math/si.md). In either precision.
namespace stiction::inline STICTION_ISA {

/// Velocity of a body.
template <class T>
struct Twist {
  Vector3<T> linear, angular;
};

/// Response of a body to an impulse.
template <class T>
struct InverseMass {
  T mass;
  Symmetric3<T> inertia;
};

/// The rows' directions.
template <class T>
struct ContactFrame {
  Vector3<T> n, t1, t2;
};

/// With the tangents of contact_tangents(), in lanes too.
template <class T>
STICTION_HD ContactFrame<T> frame_of(const Vector3<T>& n) {
  const T normal[3] = {n.x, n.y, n.z};
  T first[3];
  T second[3];
  const T sign = select(n.z < T(0), T(-1), T(1));
  detail::complete_tangents(normal, sign, div_(T(-1), sign + n.z), first, second);
  return {n, {first[0], first[1], first[2]}, {second[0], second[1], second[2]}};
}

/// Velocity of the point of a body at `arm` from its centre of mass.
template <class T>
STICTION_HD Vector3<T> point_velocity(const Twist<T>& twist, const Vector3<T>& arm) {
  return add_cross(twist.linear, twist.angular, arm);
}

/// An impulse's components in world axes.
template <class T>
STICTION_HD Vector3<T> to_world(const ContactFrame<T>& frame, T n, T t1, T t2) {
  return add_scaled(add_scaled({n * frame.n.x, n * frame.n.y, n * frame.n.z}, t1, frame.t1), t2, frame.t2);
}

/// The twist after an impulse at the centre of mass and one about it.
template <class T>
STICTION_HD Twist<T> pushed(const Twist<T>& twist, const InverseMass<T>& inverse, const Vector3<T>& impulse,
                            const Vector3<T>& about_center) {
  return {add_scaled(twist.linear, inverse.mass, impulse), add_product(twist.angular, inverse.inertia, about_center)};
}

/// Lower triangle of a contact's block of J M^-1 J', rows n, t1, t2.
template <class T>
struct ContactBlock {
  T nn, n1, n2, t11, t12, t22;
};

/// One body's share of it, added.
template <class T>
STICTION_HD void add_body(ContactBlock<T>& block, const InverseMass<T>& inverse, const Vector3<T>& arm,
                          const ContactFrame<T>& frame) {
  const Vector3<T> zero{T(0), T(0), T(0)};
  const Vector3<T> n = cross(arm, frame.n);
  const Vector3<T> t1 = cross(arm, frame.t1);
  const Vector3<T> t2 = cross(arm, frame.t2);
  const Vector3<T> spin_n = add_product(zero, inverse.inertia, n);
  const Vector3<T> spin_1 = add_product(zero, inverse.inertia, t1);
  const Vector3<T> spin_2 = add_product(zero, inverse.inertia, t2);
  block.nn = block.nn + (inverse.mass + dot(n, spin_n));
  block.n1 = block.n1 + dot(t1, spin_n);
  block.n2 = block.n2 + dot(t2, spin_n);
  block.t11 = block.t11 + (inverse.mass + dot(t1, spin_1));
  block.t12 = block.t12 + dot(t2, spin_1);
  block.t22 = block.t22 + (inverse.mass + dot(t2, spin_2));
}

}  // namespace stiction::inline STICTION_ISA
