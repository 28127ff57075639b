#pragma once

#include "core/algorithm/rigid/vector3.hpp"

/// Numbers of one lane, where a vector has those of all.
namespace stiction::inline STICTION_ISA {

template <class Real>
STICTION_HD Scalar<Real> number_in(const Real& value, int lane) {
  return reinterpret_cast<const Scalar<Real>*>(&value)[lane];
}
template <class Real>
STICTION_HD Vector3<Scalar<Real>> vector_in(const Vector3<Real>& v, int lane) {
  return {number_in(v.x, lane), number_in(v.y, lane), number_in(v.z, lane)};
}

template <class Real>
STICTION_HD void put_number(Real& to, int lane, Scalar<Real> number) {
  reinterpret_cast<Scalar<Real>*>(&to)[lane] = number;
}
template <class Real>
STICTION_HD void put_vector(Vector3<Real>& to, int lane, const Vector3<Scalar<Real>>& v) {
  put_number(to.x, lane, v.x);
  put_number(to.y, lane, v.y);
  put_number(to.z, lane, v.z);
}

}  // namespace stiction::inline STICTION_ISA
