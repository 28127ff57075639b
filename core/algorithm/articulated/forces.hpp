#pragma once

#include "core/algorithm/articulated/inertia.hpp"

/// Forces without contacts: bias by recursive Newton and Euler, springs, damping and actuators, and the acceleration
/// they make (R. Featherstone, Rigid Body Dynamics Algorithms, 2008, chapter 5).
namespace stiction::inline STICTION_ISA {

/// Adds a joint's motion of a body, and its change by the motion of the axes.
template <class Real, int kStride>
STICTION_HD void add_joint_motion(const Robots<Real, kStride>& robots, Index& dof, Twist<Real>& v, Twist<Real>& a) {
  const auto& work = robots.work;
  const DofKind kind = robots.model.dof[dof].kind;
  const auto qvel = work.qvel.from(dof);
  if (kind == DofKind::x) {
    v.linear = added(v.linear, Vector3<Real>{qvel[0], qvel[1], qvel[2]});
    dof += 3;
    return;
  }
  if (kind == DofKind::slide) {
    const Vector3<Real> own = scaled(qvel[0], work.motion[dof].linear);
    a.linear = add_cross(a.linear, v.angular, own);
    v.linear = added(v.linear, own);
    ++dof;
    return;
  }
  const Index count = kind == DofKind::spin ? 3 : 1;
  Twist<Real> own{scaled(qvel[0], work.motion[dof].linear), scaled(qvel[0], work.motion[dof].angular)};
  for (Index k = 1; k < count; ++k) own = add_scaled(own, qvel[k], work.motion[dof + k]);
  a = added(a, cross_motion(v, own));
  v = added(v, own);
  dof += count;
}

/// Turns forces on bodies into forces of degrees of freedom, adding up from the leaves.
template <class Real, int kStride>
STICTION_HD void project_forces(const Robots<Real, kStride>& robots, const RobotNumbers<Real, kStride>& to) {
  const auto& model = robots.model;
  auto& work = robots.work;
  for (Index b = model.bodies - 1; b > 0; --b) {
    const Index parent = model.body[b].parent;
    if (parent > 0) work.force.put(parent, added(work.force[parent], work.force[b]));
  }
  for (Index k = 0; k < model.dof_count; ++k) to[k] = force_along(robots, k, work.force[model.dof[k].body]);
}

/// Forces that hold the present velocities against gravity.
template <class Real, int kStride>
STICTION_HD_OUTLINE void find_bias(const Robots<Real, kStride>& robots) {
  const auto& model = robots.model;
  auto& work = robots.work;
  for (Index b = 1; b < model.bodies; ++b) {
    const auto& body = model.body[b];
    Twist<Real> v = no_motion<Real>(), a = no_motion<Real>();
    if (body.parent > 0) {
      v = work.velocity[body.parent];
      a = work.acceleration[body.parent];
    } else {
      a.linear = {Real(-model.gravity[0]), Real(-model.gravity[1]), Real(-model.gravity[2])};
    }
    for (Index dof = body.dof_begin; dof < body.dof_end;) add_joint_motion(robots, dof, v, a);
    work.velocity.put(b, v);
    work.acceleration.put(b, a);
    const Real mass = mass_of(robots, b);
    const SpatialInertia<Real>& inertia = work.inertia[b];
    work.force.put(b, added(momentum(inertia, mass, a), cross_force(v, momentum(inertia, mass, v))));
  }
  project_forces(robots, work.bias);
}

/// Forces that hold parts of bodies' weights, in the place of passive ones.
template <class Real, int kStride>
STICTION_HD void find_held_weights(const Robots<Real, kStride>& robots) {
  const auto& model = robots.model;
  auto& work = robots.work;
  const Vector3<Real> gravity = in_lanes<Real>(model.gravity);
  for (Index b = 1; b < model.bodies; ++b) {
    const Vector3<Real> force = scaled(-held_mass_of(robots, b), gravity);
    work.force.put(b, {force, cross(subtract(work.centre[b], work.tree_centre[model.body[b].root]), force)});
  }
  project_forces(robots, work.passive);
}

/// Forces of held weights, damping and springs.
template <class Real, int kStride>
STICTION_HD void find_passive_forces(const Robots<Real, kStride>& robots) {
  const auto& model = robots.model;
  auto& work = robots.work;
  for (Index k = 0; k < model.dof_count; ++k) work.passive[k] = Real(0);
  if (model.holds_weight) find_held_weights(robots);
  for (Index k = 0; k < model.dof_count; ++k)
    work.passive[k] = fma_(-damping_of(robots, k), work.qvel[k], work.passive[k]);
  for (Index j = 0; j < model.joints; ++j) {
    const auto& joint = model.joint[j];
    if (joint.stiffness == 0) continue;
    const Real stretch = work.qpos[joint.q] - Real(joint.rest);
    work.passive[joint.dof] = fma_(Real(-joint.stiffness), stretch, work.passive[joint.dof]);
  }
}

/// Forces of actuators, and by how much they fall with velocities where the integrator asks for it. Clipped forces do
/// not, as in MuJoCo's `implicitfast`.
template <class Real, int kStride>
STICTION_HD void find_actuator_forces(const Robots<Real, kStride>& robots) {
  const auto& model = robots.model;
  auto& work = robots.work;
  for (Index k = 0; k < model.dof_count; ++k) {
    work.actuator[k] = Real(0);
    if (work.braking.data != nullptr) work.braking[k] = Real(0);
  }
  for (Index i = 0; i < model.actuator_count; ++i) {
    const auto& actuator = model.actuator[i];
    const Real gear(actuator.gear);
    const Real length = gear * work.qpos[actuator.q];
    const Real speed = gear * work.qvel[actuator.dof];
    const auto affine = [&](VariedArray which, const Scalar<Real>(&common)[3]) {
      const auto of = [&](Index k) { return own_or(robots, which, 3 * i + k, common[k]); };
      return fma_(of(2), speed, fma_(of(1), length, of(0)));
    };
    const Real control = clamp_(work.ctrl[i], Real(actuator.control[0]), Real(actuator.control[1]));
    const Real gain = affine(VariedArray::actuator_gain, actuator.gain);
    const Real bias = affine(VariedArray::actuator_bias, actuator.bias);
    const Real force = fma_(gain, control, bias);
    const Real clipped = clamp_(force, Real(actuator.force[0]), Real(actuator.force[1]));
    work.actuator[actuator.dof] = fma_(gear, clipped, work.actuator[actuator.dof]);
    if (work.braking.data == nullptr) continue;
    const Real slope = fma_(own_or(robots, VariedArray::actuator_gain, 3 * i + 2, actuator.gain[2]), control,
                            own_or(robots, VariedArray::actuator_bias, 3 * i + 2, actuator.bias[2]));
    const Real moved = select(and_(force > Real(actuator.force[0]), force < Real(actuator.force[1])), slope, Real(0));
    work.braking[actuator.dof] = fma_(-(gear * gear), moved, work.braking[actuator.dof]);
  }
  for (Index j = 0; j < model.joints; ++j) {
    const auto& joint = model.joint[j];
    if (!joint.is_force_limited) continue;
    Real& force = work.actuator[joint.dof];
    const Real least(joint.force_range[0]), most(joint.force_range[1]);
    if (work.braking.data != nullptr) {
      Real& braking = work.braking[joint.dof];
      braking = select(and_(force > least, force < most), braking, Real(0));
    }
    force = clamp_(force, least, most);
  }
}

/// The acceleration without contacts and limits. Returns the lanes in which M is positive definite.
template <class Real, int kStride>
STICTION_HD_OUTLINE Mask<Real> find_smooth_acceleration(const Robots<Real, kStride>& robots) {
  auto& work = robots.work;
  find_passive_forces(robots);
  find_actuator_forces(robots);
  for (Index k = 0; k < robots.model.dof_count; ++k) {
    work.smooth[k] = ((work.passive[k] - work.bias[k]) + work.applied[k]) + work.actuator[k];
    work.qacc_smooth[k] = work.smooth[k];
  }
  const Mask<Real> definite = factor_masses(robots, work.factor, work.inverse, false);
  solve_masses(robots, work.factor, work.inverse, work.qacc_smooth);
  return definite;
}

}  // namespace stiction::inline STICTION_ISA
