#pragma once

#include <array>
#include <span>
#include <vector>

#include "stiction/bodies.hpp"
#include "stiction/jacobian.hpp"

namespace stiction {

/// One step of bodies as a batch of J and M, in double (docs/howto/bodies.md). A body has six degrees of freedom, a
/// contact three rows.
struct BodyJacobians {
  JacobianBatch<double> batch;
  std::vector<double> impulse;          ///< reactions                                             (3 * contact_count)
  std::vector<double> target_by_depth;  ///< derivative of the velocity that a contact asks for [1/s]  (contact_count)
  std::vector<double> bounce;           ///< restitution of a contact that asks for it, else 0 [-]     (contact_count)
};

/// `twist`: where the step begins, in place of the batch's. Nothing is kinematic. A singular inverse inertia becomes a
/// mass that is not definite, so that its environment is refused.
template <class Real>
BodyJacobians body_jacobians(const BodyBatchView<Real>& bodies, std::span<const Real> twist,
                             std::span<const Real> impulse, const TimeStepping& stepping, Law law);

/// Rows n, t1, t2 of a contact: the direction, and its moment about a body's centre of mass.
struct ContactRows {
  std::array<std::array<double, 6>, 3> row;
};
/// The rows of the body at whose `arm` the contact is; those of body a are the negative.
template <class Real>
ContactRows contact_rows(const Real* normal, const Real* arm);

}  // namespace stiction
