#pragma once

#include "core/algorithm/collision/pose.hpp"
#include "core/algorithm/rigid/contact_point.hpp"

/// Motions, forces and inertias of bodies as six numbers about one point of their tree (R. Featherstone, Rigid Body
/// Dynamics Algorithms, 2008, chapter 2). A Twist is a motion, or a force with its moment.
namespace stiction::inline STICTION_ISA {

/// Inertia about a point, but for the mass, which is the model's.
template <class Real>
struct SpatialInertia {
  Symmetric3<Real> about;
  Vector3<Real> moment;  ///< mass times the centre's place from the point
};

/// Constants as a vector in every lane.
template <class Real, class T>
STICTION_HD Vector3<Real> in_lanes(const T (&p)[3]) {
  return {Real(p[0]), Real(p[1]), Real(p[2])};
}

template <class Real>
STICTION_HD Vector3<Real> no_vector() {
  return {Real(0), Real(0), Real(0)};
}

template <class Real>
STICTION_HD Twist<Real> no_motion() {
  return {no_vector<Real>(), no_vector<Real>()};
}

template <class Real>
STICTION_HD Twist<Real> added(const Twist<Real>& a, const Twist<Real>& b) {
  return {added(a.linear, b.linear), added(a.angular, b.angular)};
}

template <class Real>
STICTION_HD Twist<Real> add_scaled(const Twist<Real>& base, Real s, const Twist<Real>& a) {
  return {add_scaled(base.linear, s, a.linear), add_scaled(base.angular, s, a.angular)};
}

/// Power of a force at a motion.
template <class Real>
STICTION_HD Real dot(const Twist<Real>& a, const Twist<Real>& b) {
  return dot(a.angular, b.angular) + dot(a.linear, b.linear);
}

template <class Real>
STICTION_HD Twist<Real> momentum(const SpatialInertia<Real>& inertia, Real mass, const Twist<Real>& v) {
  return {add_cross(scaled(mass, v.linear), v.angular, inertia.moment),
          add_product(cross(inertia.moment, v.linear), inertia.about, v.angular)};
}

/// Change of a motion that is fixed in a frame moving by v.
template <class Real>
STICTION_HD Twist<Real> cross_motion(const Twist<Real>& v, const Twist<Real>& a) {
  return {add_cross(cross(v.linear, a.angular), v.angular, a.linear), cross(v.angular, a.angular)};
}
/// Change of a force that is fixed in a frame moving by v.
template <class Real>
STICTION_HD Twist<Real> cross_force(const Twist<Real>& v, const Twist<Real>& f) {
  return {cross(v.angular, f.linear), add_cross(cross(v.linear, f.linear), v.angular, f.angular)};
}

/// One rotation after another: first b, then a.
template <class Real>
STICTION_HD Quaternion<Real> product(const Quaternion<Real>& a, const Quaternion<Real>& b) {
  return {fma_(a.w, b.w, -fma_(a.x, b.x, fma_(a.y, b.y, a.z * b.z))),
          fma_(a.w, b.x, fma_(a.x, b.w, fma_(a.y, b.z, -(a.z * b.y)))),
          fma_(a.w, b.y, fma_(a.y, b.w, fma_(a.z, b.x, -(a.x * b.z)))),
          fma_(a.w, b.z, fma_(a.z, b.w, fma_(a.x, b.y, -(a.y * b.x))))};
}

/// A vector of a body in world axes.
template <class Real>
STICTION_HD Vector3<Real> rotated(const Quaternion<Real>& q, const Vector3<Real>& a) {
  const Vector3<Real> axis{q.x, q.y, q.z};
  const Vector3<Real> twice = scaled(Real(2), cross(axis, a));
  return add_cross(add_scaled(a, q.w, twice), axis, twice);
}

}  // namespace stiction::inline STICTION_ISA
