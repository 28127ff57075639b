#pragma once

#include "core/base/real.hpp"

namespace stiction::inline STICTION_ISA {

/// Three numbers in world axes, and the operations on them that bodies need.
template <class T>
struct Vector3 {
  T x, y, z;
};

template <class T>
STICTION_HD T dot(const Vector3<T>& a, const Vector3<T>& b) {
  return fma_(a.z, b.z, fma_(a.y, b.y, a.x * b.x));
}

/// base + a x b.
template <class T>
STICTION_HD Vector3<T> add_cross(const Vector3<T>& base, const Vector3<T>& a, const Vector3<T>& b) {
  return {fma_(a.y, b.z, fma_(-a.z, b.y, base.x)), fma_(a.z, b.x, fma_(-a.x, b.z, base.y)),
          fma_(a.x, b.y, fma_(-a.y, b.x, base.z))};
}

template <class T>
STICTION_HD Vector3<T> cross(const Vector3<T>& a, const Vector3<T>& b) {
  return {fma_(a.y, b.z, -(a.z * b.y)), fma_(a.z, b.x, -(a.x * b.z)), fma_(a.x, b.y, -(a.y * b.x))};
}

/// base + s a.
template <class T>
STICTION_HD Vector3<T> add_scaled(const Vector3<T>& base, T s, const Vector3<T>& a) {
  return {fma_(s, a.x, base.x), fma_(s, a.y, base.y), fma_(s, a.z, base.z)};
}

template <class T>
STICTION_HD Vector3<T> subtract(const Vector3<T>& a, const Vector3<T>& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}

/// A symmetric matrix.
template <class T>
struct Symmetric3 {
  T xx, xy, xz, yy, yz, zz;
};

/// base + m a.
template <class T>
STICTION_HD Vector3<T> add_product(const Vector3<T>& base, const Symmetric3<T>& m, const Vector3<T>& a) {
  return {fma_(m.xz, a.z, fma_(m.xy, a.y, fma_(m.xx, a.x, base.x))),
          fma_(m.yz, a.z, fma_(m.yy, a.y, fma_(m.xy, a.x, base.y))),
          fma_(m.zz, a.z, fma_(m.yz, a.y, fma_(m.xz, a.x, base.z)))};
}

/// The first three numbers of an array, of one precision, in another.
template <class T, class Array>
STICTION_HD Vector3<T> load3(const Array& p) {
  return {static_cast<T>(p[0]), static_cast<T>(p[1]), static_cast<T>(p[2])};
}
template <class T, class Array>
STICTION_HD Symmetric3<T> load6(const Array& p) {
  return {static_cast<T>(p[0]), static_cast<T>(p[1]), static_cast<T>(p[2]),
          static_cast<T>(p[3]), static_cast<T>(p[4]), static_cast<T>(p[5])};
}

}  // namespace stiction::inline STICTION_ISA
