#pragma once

#include <limits>

#include "core/algorithm/articulated/workspace.hpp"

/// Constants of the robots in lanes: the environments' own where the batch has them, else the model's in every lane.
namespace stiction::inline STICTION_ISA {

/// Numbers that lanes have of their own; null: they have the model's.
template <class Real, int kStride>
STICTION_HD RobotNumbers<Real, kStride> own_numbers(const Robots<Real, kStride>& robots, VariedArray which) {
  return robots.work.varied[static_cast<std::size_t>(which)];
}
template <class Real, int kStride>
STICTION_HD Real own_or(const Robots<Real, kStride>& robots, VariedArray which, Index place, Scalar<Real> common) {
  const auto own = own_numbers(robots, which);
  return own.data != nullptr ? own[place] : Real(common);
}

template <class Real, int kStride>
STICTION_HD Real mass_of(const Robots<Real, kStride>& robots, Index b) {
  return own_or(robots, VariedArray::body_mass, b, robots.model.body[b].mass);
}
template <class Real, int kStride>
STICTION_HD Real subtree_mass_of(const Robots<Real, kStride>& robots, Index b) {
  const auto& own = robots.work.subtree_mass;
  return own.data != nullptr ? own[b] : Real(robots.model.body[b].subtree_mass);
}
/// Part of a body's mass whose weight a passive force holds.
template <class Real, int kStride>
STICTION_HD Real held_mass_of(const Robots<Real, kStride>& robots, Index b) {
  return Real(robots.model.body[b].held_share) * mass_of(robots, b);
}

/// Inertia of a body about all axes, and the excess about the k-th of its further ones.
template <class Real, int kStride>
STICTION_HD Real round_inertia_of(const Robots<Real, kStride>& robots, Index b) {
  const auto& body = robots.model.body[b];
  return own_or(robots, VariedArray::body_inertia, 3 * b + body.moment[0], body.round);
}
template <class Real, int kStride>
STICTION_HD Real more_inertia_of(const Robots<Real, kStride>& robots, Index b, Index k) {
  const auto& body = robots.model.body[b];
  const auto own = own_numbers(robots, VariedArray::body_inertia);
  if (own.data == nullptr) return Real(body.more[k]);
  const auto d = own.from(3 * b);
  const Real more = d[body.moment[1 + k]] - d[body.moment[0]];
  const Real same = Real(static_cast<Scalar<Real>>(kSameMoments)) * ((d[0] + d[1]) + d[2]);
  return select(abs_(more) < same, Real(0), more);
}

template <class Real, int kStride>
STICTION_HD Real damping_of(const Robots<Real, kStride>& robots, Index dof) {
  return own_or(robots, VariedArray::dof_damping, dof, robots.model.dof[dof].damping);
}
/// Damping times the step.
template <class Real, int kStride>
STICTION_HD Real step_damping_of(const Robots<Real, kStride>& robots, Index dof) {
  const auto own = own_numbers(robots, VariedArray::dof_damping);
  return own.data != nullptr ? Real(robots.model.step) * own[dof] : Real(robots.model.dof[dof].step_damping);
}
template <class Real, int kStride>
STICTION_HD Real armature_of(const Robots<Real, kStride>& robots, Index dof) {
  return own_or(robots, VariedArray::dof_armature, dof, robots.model.dof[dof].armature);
}
template <class Real, int kStride>
STICTION_HD Real friction_loss_of(const Robots<Real, kStride>& robots, Index loss) {
  const auto& one = robots.model.loss[loss];
  return own_or(robots, VariedArray::dof_friction_loss, one.dof, one.most);
}

template <class Real, int kStride>
STICTION_HD Real friction_of(const Robots<Real, kStride>& robots, Index pair, Index k) {
  return own_or(robots, VariedArray::pair_friction, 5 * pair + k, robots.model.pair[pair].friction[k]);
}

/// Lanes in which all numbers of an array are finite and in range.
template <class Real, int kApart>
STICTION_HD Mask<Real> are_in_range(const LaneElements<Real, Real, kApart>& numbers, Index count, VariedArray which) {
  using T = Scalar<Real>;
  constexpr T kMost = std::numeric_limits<T>::max(), kLeast = std::numeric_limits<T>::min();
  const bool has_sign = which == VariedArray::actuator_gain || which == VariedArray::actuator_bias;
  const Real most(kMost), least(has_sign ? -kMost : which == VariedArray::pair_friction ? kLeast : T(0));
  Mask<Real> found = most == most;
  for (Index k = 0; k < count; ++k) found = and_(found, and_(numbers[k] >= least, numbers[k] <= most));
  return found;
}
/// The flag of an environment with a number that is not.
STICTION_HD std::uint32_t flag_of(VariedArray which) {
  if (which == VariedArray::pair_friction) return kFlagNegativeFriction;
  const bool is_mass =
      which == VariedArray::body_mass || which == VariedArray::body_inertia || which == VariedArray::dof_armature;
  return is_mass ? kFlagBadMass : kFlagNonFiniteInput;
}

/// Adds masses of the lanes up from the leaves.
template <class Real, int kStride>
STICTION_HD void find_subtree_masses(const Robots<Real, kStride>& robots) {
  const auto& sum = robots.work.subtree_mass;
  for (Index b = 0; b < robots.model.bodies; ++b) sum[b] = mass_of(robots, b);
  for (Index b = robots.model.bodies - 1; b > 0; --b) {
    const Index parent = robots.model.body[b].parent;
    sum[parent] = sum[parent] + sum[b];
  }
}

}  // namespace stiction::inline STICTION_ISA
