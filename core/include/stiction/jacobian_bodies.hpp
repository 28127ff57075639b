#pragma once

/// \file
/// Rigid bodies that are given as J and M (docs/howto/jacobian.md).

#include <span>
#include <vector>

#include "stiction/bodies.hpp"
#include "stiction/jacobian.hpp"

namespace stiction {

/// A Jacobian batch as bodies and contacts, for the solvers of bodies: sequential impulses, and Newton's method with
/// its preconditioners.
template <class Real>
struct JacobianBodies {
  BodyBatch<Real> batch;         ///< a body for six degrees of freedom, a contact for each cone
  TimeStepping stepping;         ///< a step of 1: its velocities are those of the Jacobian batch, its cfm is R
  std::vector<double> tangents;  ///< of each contact, the cone's tangential rows in the contact's frame, a 2 x 2
                                 ///< orthogonal matrix row by row (4 * contact_count)
};

/// Finds the bodies of a host batch. Each environment has six degrees of freedom a body: velocity of the centre of mass
/// and spin, in world axes. M has a mass and an inertia for each. Each cone has a normal and two tangential rows of one
/// point, of one body or between two; they are orthogonal and of length 1. A cone has one friction and no tangential
/// target. All rows of the batch have one R.
///
/// \throws Error(unsupported) that names the first environment, body or row that is no such thing.
template <class Real>
[[nodiscard]] JacobianBodies<Real> as_bodies(const JacobianBatchView<Real>& batch);

/// Impulses or motions of contacts, (n, t1, t2) each, in the rows of the cones (3 * contact_count). \throws
/// Error(invalid_argument) on another length.
template <class Real>
[[nodiscard]] std::vector<Real> to_rows(const JacobianBodies<Real>& bodies, std::span<const Real> by_contact);
/// Rows of cones as impulses or motions of contacts, the inverse of to_rows().
template <class Real>
[[nodiscard]] std::vector<Real> to_contacts(const JacobianBodies<Real>& bodies, std::span<const Real> by_row);

}  // namespace stiction
