#pragma once

#include "core/algorithm/rigid/body_system.hpp"

namespace stiction::inline STICTION_ISA {

/// The velocity that a contact's normal row asks for (docs/howto/bodies.md). In double, from the numbers a sub-step
/// begins with: the sweeps and the judge must not find themselves on two sides of a threshold.
template <class T>
STICTION_HD T target_velocity(const SiParams& params, T depth, T restitution, T approach) {
  const T gap = -depth;
  const T step(params.step);
  const T way = select(gap > T(0), -gap, T(params.erp) * max_(depth - T(params.slop), T(0)));
  const T position = div_(way, step);
  const auto bounces =
      and_(and_(restitution > T(0), approach > T(params.restitution_threshold)), approach * step >= gap);
  return select(bounces, max_(restitution * approach, position), position);
}

/// Twist in double at the beginning of a sub-step.
template <class Real, Law kLaw, int kStride>
STICTION_HD Twist<double> start_twist(const BodySystem<Real, kLaw, kStride>& s, Index slot) {
  return twist_at<double>(s.twist_row(s.start, slot));
}

/// Computes the change of a body's twist by forces in one sub-step.
template <class Real>
STICTION_HD Twist<double> change_of(const BodyEnv<Real>& env, const SiParams& params, Index body) {
  if (body >= env.bodies || env.twist_change == nullptr || env.is_kinematic(body))
    return {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  const double share = div_(1.0, static_cast<double>(params.substeps));
  const Vector3<double> zero{0.0, 0.0, 0.0};
  const Real* change = env.twist_change + 6 * static_cast<Offset>(body);
  return {add_scaled(zero, share, load3<double>(change)), add_scaled(zero, share, load3<double>(change + 3))};
}

/// Twist in double after a sub-step without reactions.
template <class Real, Law kLaw, int kStride>
STICTION_HD Twist<double> free_twist(const BodyEnv<Real>& env, const BodySystem<Real, kLaw, kStride>& s,
                                     const SiParams& params, Index slot) {
  const Twist<double> start = start_twist(s, slot);
  const Twist<double> change = change_of(env, params, slot);
  return {add_scaled(start.linear, 1.0, change.linear), add_scaled(start.angular, 1.0, change.angular)};
}

/// Position of a contact, in double, from the batch's own numbers.
template <class T>
struct ExactGeometry {
  Vector3<T> arm_a, arm_b;
  ContactFrame<T> frame;
};
struct ExactContact : ExactGeometry<double> {
  Index contact, side_a, side_b;
};

template <class Real>
STICTION_HD ExactContact exact_contact(const BodyEnv<Real>& env, Index p) {
  const Index c = env.contact_order[p];
  const Offset slot = 3 * static_cast<Offset>(c);
  return {
      {load3<double>(env.arm_a + slot), load3<double>(env.arm_b + slot), frame_of(load3<double>(env.normal + slot))},
      c,
      env.sides[2 * static_cast<Offset>(p)],
      env.sides[2 * static_cast<Offset>(p) + 1]};
}

/// Relative velocity of a contact for twists of the two bodies.
template <class T>
STICTION_HD Vector3<T> relative_velocity(const Twist<T>& a, const Vector3<T>& arm_a, const Twist<T>& b,
                                         const Vector3<T>& arm_b) {
  return subtract(point_velocity(b, arm_b), point_velocity(a, arm_a));
}

/// The bias of a contact's normal row, minus its target velocity, for the twists that the sub-step begins with.
template <class T>
STICTION_HD T bias_of(const SiParams& params, const ExactGeometry<T>& contact, const Twist<T>& a, const Twist<T>& b,
                      T depth, T restitution) {
  const Vector3<T> u = relative_velocity(a, contact.arm_a, b, contact.arm_b);
  return -target_velocity(params, depth, restitution, -dot(u, contact.frame.n));
}
template <class Real, Law kLaw, int kStride>
STICTION_HD double bias_of(const BodyEnv<Real>& env, const BodySystem<Real, kLaw, kStride>& s, const SiParams& params,
                           Index p, const ExactContact& contact) {
  return bias_of<double>(params, contact, start_twist(s, slot_of(contact.side_a)),
                         start_twist(s, slot_of(contact.side_b)), static_cast<double>(s.depth.at(0, p)),
                         static_cast<double>(env.restitution[contact.contact]));
}

/// The motion of a contact without reactions, b, for the twists that forces alone lead to.
template <class T>
STICTION_HD void free_motion(const ExactGeometry<T>& contact, const Twist<T>& a, const Twist<T>& b, T bias,
                             T (&motion)[3]) {
  const Vector3<T> u = relative_velocity(a, contact.arm_a, b, contact.arm_b);
  motion[0] = dot(u, contact.frame.n) + bias;
  motion[1] = dot(u, contact.frame.t1);
  motion[2] = dot(u, contact.frame.t2);
}

}  // namespace stiction::inline STICTION_ISA
