#pragma once

#include "core/algorithm/articulated/workspace.hpp"
#include "core/base/sine.hpp"

/// Places of bodies, joints and shapes (R. Featherstone, Rigid Body Dynamics Algorithms, 2008, chapter 4).
namespace stiction::inline STICTION_ISA {

template <class Real>
STICTION_HD void put_quaternion(Real* to, const Quaternion<Real>& q) {
  to[0] = q.w;
  to[1] = q.x;
  to[2] = q.y;
  to[3] = q.z;
}

/// The place of a body.
template <class Real>
struct Pose {
  Vector3<Real> position;
  Quaternion<Real> orientation;
};

/// Moves a body by one of its joints.
template <class Real>
STICTION_HD void move_by(const Robots<Real>& robots, Index j, Pose<Real>& pose) {
  const auto& joint = robots.model.joint[j];
  const Real* const q = robots.work.qpos + joint.q;
  Vector3<Real>& anchor = robots.work.anchor[j];
  if (joint.kind == JointKind::free) {
    pose = {{q[0], q[1], q[2]}, normalised(load_quaternion(q + 3))};
    anchor = pose.position;
    robots.work.axis[j] = no_vector<Real>();
    return;
  }
  const Vector3<Real> axis = rotated(pose.orientation, in_lanes<Real>(joint.axis));
  const Vector3<Real> offset = in_lanes<Real>(joint.position);
  anchor = joint.is_offset ? added(pose.position, rotated(pose.orientation, offset)) : pose.position;
  robots.work.axis[j] = axis;
  if (joint.kind == JointKind::slide) {
    pose.position = add_scaled(pose.position, q[0] - Real(joint.reference), axis);
    return;
  }
  if (joint.kind == JointKind::ball) {
    pose.orientation = product(pose.orientation, normalised(load_quaternion(q)));
  } else {
    const auto half = sine_cosine((q[0] - Real(joint.reference)) * Real(Scalar<Real>(0.5)));
    const Vector3<Real> turn = scaled(half.sine, in_lanes<Real>(joint.axis));
    pose.orientation = product(pose.orientation, {half.cosine, turn.x, turn.y, turn.z});
  }
  if (joint.is_offset) pose.position = subtract(anchor, rotated(pose.orientation, offset));
}

template <class Real>
STICTION_HD Pose<Real> pose_of(const Robots<Real>& robots, Index b) {
  const auto& body = robots.model.body[b];
  const auto& work = robots.work;
  const auto& o = body.orientation;
  const Quaternion<Real> own{Real(o[0]), Real(o[1]), Real(o[2]), Real(o[3])};
  Pose<Real> pose{in_lanes<Real>(body.position), own};
  if (body.parent > 0) {
    const Quaternion<Real>& parent = work.orientation[body.parent];
    pose.position = added(work.position[body.parent], along(work.axes[body.parent], pose.position));
    pose.orientation = body.is_turned ? product(parent, own) : parent;
  }
  for (Index j = body.joint_begin; j < body.joint_end; ++j) move_by(robots, j, pose);
  return pose;
}

template <class Real>
STICTION_HD Axes3<Real> constant_axes(const Scalar<Real> (&m)[9]) {
  return {
      {Real(m[0]), Real(m[1]), Real(m[2])}, {Real(m[3]), Real(m[4]), Real(m[5])}, {Real(m[6]), Real(m[7]), Real(m[8])}};
}

/// Places bodies, joints and geoms. Some need the z axis alone.
template <class Real>
STICTION_HD_OUTLINE void place_bodies(const Robots<Real>& robots) {
  const auto& model = robots.model;
  auto& work = robots.work;
  work.position[0] = no_vector<Real>();
  work.orientation[0] = {Real(1), Real(0), Real(0), Real(0)};
  work.axes[0] = axes_of(work.orientation[0]);
  for (Index b = 1; b < model.bodies; ++b) {
    const Pose<Real> pose = pose_of(robots, b);
    work.position[b] = pose.position;
    work.orientation[b] = pose.orientation;
    work.axes[b] = axes_of(pose.orientation);
    work.centre[b] = added(pose.position, along(work.axes[b], in_lanes<Real>(model.body[b].centre)));
  }
  for (Index g = 0; g < model.geoms; ++g) {
    const auto& geom = model.geom[g];
    const Axes3<Real>& axes = work.axes[geom.body];
    const Axes3<Real> own = constant_axes<Real>(geom.axes);
    work.geom_position[g] = added(work.position[geom.body], along(axes, in_lanes<Real>(geom.position)));
    work.geom_axes[g].z = along(axes, own.z);
    if (!has_three_axes(geom.kind)) continue;
    work.geom_axes[g].x = along(axes, own.x);
    work.geom_axes[g].y = along(axes, own.y);
  }
}

}  // namespace stiction::inline STICTION_ISA
