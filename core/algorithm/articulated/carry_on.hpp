#pragma once

#include "core/algorithm/articulated/inertia.hpp"
#include "core/algorithm/articulated/kinematics.hpp"

/// From accelerations to the next state.
namespace stiction::inline STICTION_ISA {

/// A quaternion turned by a spin in its own axes [rad/s] over a time [s], exactly.
template <class Real>
STICTION_HD Quaternion<Real> turned_exactly(const Quaternion<Real>& q, const Vector3<Real>& spin, Real time) {
  const Real speed = length(spin);
  const Real half_time = time * Real(Scalar<Real>(0.5));
  const auto half = sine_cosine(speed * half_time);
  const auto is_turning = speed > Real(Scalar<Real>(1e-15));
  const Real share = select(is_turning, div_(half.sine, select(is_turning, speed, Real(1))), half_time);
  return normalised(product(q, Quaternion<Real>{half.cosine, share * spin.x, share * spin.y, share * spin.z}));
}

/// Moves coordinates `from` by velocities over a time.
template <class Real, int kStride>
STICTION_HD_OUTLINE void move_coordinates(const Robots<Real, kStride>& robots, const RobotNumbers<Real, kStride>& from,
                                          const RobotNumbers<Real, kStride>& qvel, Real time,
                                          const RobotNumbers<Real, kStride>& to) {
  for (Index j = 0; j < robots.model.joints; ++j) {
    const auto& joint = robots.model.joint[j];
    auto v = qvel.from(joint.dof);
    Index q = joint.q;
    if (joint.kind == JointKind::hinge || joint.kind == JointKind::slide) {
      to[q] = fma_(time, v[0], from[q]);
      continue;
    }
    if (joint.kind == JointKind::free) {
      for (Index k = 0; k < 3; ++k) to[q + k] = fma_(time, v[k], from[q + k]);
      q += 3;
      v = v.from(3);
    }
    const Quaternion<Real> turned = turned_exactly(quaternion_of(from.from(q)), Vector3<Real>{v[0], v[1], v[2]}, time);
    to.from(q).template as<Quaternion<Real>>().put(0, turned);
  }
}

/// Rate of the rotation vector u [rad] of an orientation that has turned by u and turns by w [rad/s], in body axes. It
/// is the inverse of the exponential's derivative (H. Munthe-Kaas, Runge-Kutta methods on Lie groups, BIT 38 (1998)).
template <class Real>
STICTION_HD Vector3<Real> rotation_rate(const Vector3<Real>& u, const Vector3<Real>& w) {
  using T = Scalar<Real>;
  const Real square = dot(u, u);
  const Real half = sqrt_(square) * Real(T(0.5));
  constexpr T kSeries[] = {T(1) / T(12), T(1) / T(720), T(1) / T(30240), T(1) / T(1209600)};
  const auto is_small = square < Real(T(0.01));
  const auto turn = sine_cosine(half);
  const Real cotangent = div_(half * turn.cosine, select(is_small, Real(1), turn.sine));
  const Real closed = div_(Real(1) - cotangent, select(is_small, Real(1), square));
  const Real second = select(is_small, polynomial<Real>(kSeries, square), closed);
  const Vector3<Real> once = cross(u, w);
  return add_scaled(add_scaled(w, Real(T(0.5)), once), second, cross(u, once));
}

/// Rates at which coordinates change at a stage that was reached by moving with `rate` over a time.
template <class Real, int kStride>
STICTION_HD_OUTLINE void renew_rates(const Robots<Real, kStride>& robots, Real time) {
  auto& work = robots.work;
  for (Index k = 0; k < robots.model.dof_count; ++k) {
    if (robots.model.dof[k].kind != DofKind::spin) {
      work.rate[k] = work.qvel[k];
      continue;
    }
    const auto rate = work.rate.from(k), spin = work.qvel.from(k);
    const Vector3<Real> turned = scaled(time, Vector3<Real>{rate[0], rate[1], rate[2]});
    const Vector3<Real> found = rotation_rate(turned, Vector3<Real>{spin[0], spin[1], spin[2]});
    rate[0] = found.x;
    rate[1] = found.y;
    rate[2] = found.z;
    k += 2;
  }
}

/// Changes in velocities of a free body that carries no joint, where its gyroscopic moment is that of the new ones.
/// With G b = w x I b + b x I w about the centre of mass, (I + h G) b = I qacc. The centre's acceleration stays.
template <class Real, int kStride>
STICTION_HD void spin_implicitly(const Robots<Real, kStride>& robots, const ArticulatedJointData<Scalar<Real>>& joint,
                                 const RobotNumbers<Real, kStride>& change) {
  const auto& work = robots.work;
  const Real step(robots.model.step);
  const Axes3<Real>& axes = work.axes[joint.body];
  const SpatialInertia<Real>& composite = work.composite[joint.body];
  const Symmetric3<Real>& inertia = composite.about;
  const auto spin = work.qvel.from(joint.dof + 3), old = work.qacc.from(joint.dof);
  const Vector3<Real> none = no_vector<Real>();
  const Vector3<Real> w = along(axes, {spin[0], spin[1], spin[2]}), before = along(axes, {old[3], old[4], old[5]});
  const Vector3<Real> momentum = add_product(none, inertia, w), moment = add_product(none, inertia, before);
  const auto column = [&](const Vector3<Real>& b) {
    const Vector3<Real> own = add_product(none, inertia, b);
    return add_scaled(own, step, add_cross(cross(w, own), b, momentum));
  };
  const Vector3<Real> x = column(axes.x), y = column(axes.y), z = column(axes.z);
  const Vector3<Real> yz = cross(y, z);
  const Real inverse = div_(Real(1), dot(x, yz));
  const Vector3<Real> own = scaled(inverse, {dot(moment, yz), dot(moment, cross(z, x)), dot(moment, cross(x, y))});
  const Vector3<Real> after = along(axes, own);
  const Vector3<Real> arm = subtract(work.tree_centre[joint.body], work.position[joint.body]);
  const Vector3<Real> turn = add_cross(cross(w, cross(after, arm)), after, cross(w, arm));
  const Vector3<Real> carried = add_scaled(cross(subtract(before, after), arm), -step, turn);
  change[0] = old[0] + carried.x;
  change[1] = old[1] + carried.y;
  change[2] = old[2] + carried.z;
  change[3] = own.x;
  change[4] = own.y;
  change[5] = own.z;
}

/// Semi-implicit Euler: velocities first. Damping and braking are those of the new velocities, if the model asks for
/// it. Returns the lanes in which M with them is positive definite.
template <class Real, int kStride>
STICTION_HD_OUTLINE Mask<Real> step_by_euler(const Robots<Real, kStride>& robots) {
  const auto& model = robots.model;
  auto& work = robots.work;
  const Real step(model.step);
  const auto& change = work.sum_qacc;
  Mask<Real> definite = step == step;
  if (model.damps_implicitly || model.acts_implicitly) {
    SerialTeam team;
    multiply_symmetric(
        team, robots.tree, [&](Index e) { return work.M[e]; }, [&](Index k) { return work.qacc[k]; }, change.numbers());
    definite = factor_masses(robots, work.damped, work.damped_inverse, true);
    solve_masses(robots, work.damped, work.damped_inverse, change);
  } else {
    for (Index k = 0; k < model.dof_count; ++k) change[k] = work.qacc[k];
  }
  for (Index j = 0; j < model.joints && model.spins_implicitly; ++j)
    if (model.joint[j].is_lone) spin_implicitly(robots, model.joint[j], change.from(model.joint[j].dof));
  for (Index k = 0; k < model.dof_count; ++k) work.qvel[k] = fma_(step, change[k], work.qvel[k]);
  move_coordinates(robots, work.qpos, work.qvel, step, work.qpos);
  return definite;
}

}  // namespace stiction::inline STICTION_ISA
