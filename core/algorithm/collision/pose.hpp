#pragma once

#include "core/algorithm/rigid/vector3.hpp"

/// A body's place: quaternions and axes, by products, quotients and square roots alone (docs/howto/stepping.md).
namespace stiction::inline STICTION_ISA {

template <class T>
struct Quaternion {
  T w, x, y, z;
};

/// A body's axes in world axes: the columns of its rotation matrix.
template <class T>
struct Axes3 {
  Vector3<T> x, y, z;
};

template <class T>
STICTION_HD Vector3<T> scaled(T s, const Vector3<T>& a) {
  return {s * a.x, s * a.y, s * a.z};
}
template <class T>
STICTION_HD Vector3<T> added(const Vector3<T>& a, const Vector3<T>& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class T>
STICTION_HD T length(const Vector3<T>& a) {
  return sqrt_(dot(a, a));
}

/// A vector of unit length, or `otherwise` where it is no longer than `least`.
template <class T>
STICTION_HD Vector3<T> direction_of(const Vector3<T>& a, const Vector3<T>& otherwise, T least) {
  const T size = length(a);
  const auto has_size = size > least;
  const T safe = select(has_size, size, T(1));
  return {select(has_size, div_(a.x, safe), otherwise.x), select(has_size, div_(a.y, safe), otherwise.y),
          select(has_size, div_(a.z, safe), otherwise.z)};
}

/// Components along axes, in world axes.
template <class T>
STICTION_HD Vector3<T> along(const Axes3<T>& axes, const Vector3<T>& a) {
  return add_scaled(add_scaled(scaled(a.x, axes.x), a.y, axes.y), a.z, axes.z);
}
/// Components of a vector along axes.
template <class T>
STICTION_HD Vector3<T> components(const Axes3<T>& axes, const Vector3<T>& a) {
  return {dot(axes.x, a), dot(axes.y, a), dot(axes.z, a)};
}

template <class T>
STICTION_HD Axes3<T> axes_of(const Quaternion<T>& q) {
  const T one(1);
  const T two(2);
  return {{one - two * (q.y * q.y + q.z * q.z), two * (q.x * q.y + q.w * q.z), two * (q.x * q.z - q.w * q.y)},
          {two * (q.x * q.y - q.w * q.z), one - two * (q.x * q.x + q.z * q.z), two * (q.y * q.z + q.w * q.x)},
          {two * (q.x * q.z + q.w * q.y), two * (q.y * q.z - q.w * q.x), one - two * (q.x * q.x + q.y * q.y)}};
}

/// Returns a quaternion of unit length; one without a length gives numbers that are not finite.
template <class T>
STICTION_HD Quaternion<T> normalised(const Quaternion<T>& q) {
  const T norm = sqrt_((q.w * q.w + q.x * q.x) + (q.y * q.y + q.z * q.z));
  return {div_(q.w, norm), div_(q.x, norm), div_(q.y, norm), div_(q.z, norm)};
}

/// Turned by `spin` [rad/s, world axes] for `step` [s]: Cayley's map, (1, step spin / 2) q of unit length. It turns by
/// 2 atan(angle / 2) instead of the angle: less by angle^3 / 12, and no sine is needed.
template <class T>
STICTION_HD Quaternion<T> turned(const Quaternion<T>& q, const Vector3<T>& spin, T step) {
  const Vector3<T> h = scaled(step * T(0.5), spin);
  return normalised(
      Quaternion<T>{q.w - ((h.x * q.x + h.y * q.y) + h.z * q.z), q.x + (h.x * q.w + (h.y * q.z - h.z * q.y)),
                    q.y + (h.y * q.w + (h.z * q.x - h.x * q.z)), q.z + (h.z * q.w + (h.x * q.y - h.y * q.x))});
}

/// The matrix with these values along these axes, in world axes.
template <class T>
STICTION_HD Symmetric3<T> spread(const Axes3<T>& r, const Vector3<T>& d) {
  return {(d.x * r.x.x * r.x.x + d.y * r.y.x * r.y.x) + d.z * r.z.x * r.z.x,
          (d.x * r.x.x * r.x.y + d.y * r.y.x * r.y.y) + d.z * r.z.x * r.z.y,
          (d.x * r.x.x * r.x.z + d.y * r.y.x * r.y.z) + d.z * r.z.x * r.z.z,
          (d.x * r.x.y * r.x.y + d.y * r.y.y * r.y.y) + d.z * r.z.y * r.z.y,
          (d.x * r.x.y * r.x.z + d.y * r.y.y * r.y.z) + d.z * r.z.y * r.z.z,
          (d.x * r.x.z * r.x.z + d.y * r.y.z * r.y.z) + d.z * r.z.z * r.z.z};
}

/// Components along axes, multiplied one by one: a diagonal matrix of a body times a vector of the world.
template <class T>
STICTION_HD Vector3<T> stretched(const Axes3<T>& axes, const Vector3<T>& d, const Vector3<T>& a) {
  const Vector3<T> c = components(axes, a);
  return along(axes, Vector3<T>{d.x * c.x, d.y * c.y, d.z * c.z});
}

template <class T>
STICTION_HD Quaternion<T> load_quaternion(const T* p) {
  return {p[0], p[1], p[2], p[3]};
}

}  // namespace stiction::inline STICTION_ISA
