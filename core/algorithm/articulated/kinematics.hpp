#pragma once

#include "core/algorithm/articulated/workspace.hpp"
#include "core/base/sine.hpp"

/// Places of bodies, joints and shapes (R. Featherstone, Rigid Body Dynamics Algorithms, 2008, chapter 4).
namespace stiction::inline STICTION_ISA {

/// The quaternion whose numbers begin there.
template <class Real, int kApart>
STICTION_HD Quaternion<Real> quaternion_of(const LaneElements<Real, Real, kApart>& numbers) {
  return numbers.template as<Quaternion<Real>>()[0];
}

/// The place of a body.
template <class Real>
struct Pose {
  Vector3<Real> position;
  Quaternion<Real> orientation;
};

/// Moves a body by one of its joints.
template <class Real, int kStride>
STICTION_HD void move_by(const Robots<Real, kStride>& robots, Index j, Pose<Real>& pose) {
  const auto& joint = robots.model.joint[j];
  const auto q = robots.work.qpos.from(joint.q);
  if (joint.kind == JointKind::free) {
    pose = {{q[0], q[1], q[2]}, normalised(quaternion_of(q.from(3)))};
    robots.work.anchor.put(j, pose.position);
    robots.work.axis.put(j, no_vector<Real>());
    return;
  }
  const Vector3<Real> axis = rotated(pose.orientation, in_lanes<Real>(joint.axis));
  const Vector3<Real> offset = in_lanes<Real>(joint.position);
  const Vector3<Real> anchor =
      joint.is_offset ? added(pose.position, rotated(pose.orientation, offset)) : pose.position;
  robots.work.anchor.put(j, anchor);
  robots.work.axis.put(j, axis);
  if (joint.kind == JointKind::slide) {
    pose.position = add_scaled(pose.position, q[0] - Real(joint.reference), axis);
    return;
  }
  if (joint.kind == JointKind::ball) {
    pose.orientation = product(pose.orientation, normalised(quaternion_of(q)));
  } else {
    const auto half = sine_cosine((q[0] - Real(joint.reference)) * Real(Scalar<Real>(0.5)));
    const Vector3<Real> turn = scaled(half.sine, in_lanes<Real>(joint.axis));
    pose.orientation = product(pose.orientation, {half.cosine, turn.x, turn.y, turn.z});
  }
  if (joint.is_offset) pose.position = subtract(anchor, rotated(pose.orientation, offset));
}

template <class Real, int kStride>
STICTION_HD Pose<Real> pose_of(const Robots<Real, kStride>& robots, Index b) {
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
template <class Real, int kStride>
STICTION_HD_OUTLINE void place_bodies(const Robots<Real, kStride>& robots) {
  const auto& model = robots.model;
  auto& work = robots.work;
  work.position.put(0, no_vector<Real>());
  work.orientation.put(0, {Real(1), Real(0), Real(0), Real(0)});
  work.axes.put(0, axes_of<Real>(work.orientation[0]));
  for (Index b = 1; b < model.bodies; ++b) {
    const Pose<Real> pose = pose_of(robots, b);
    work.position.put(b, pose.position);
    work.orientation.put(b, pose.orientation);
    work.axes.put(b, axes_of(pose.orientation));
    work.centre.put(b, added(pose.position, along(work.axes[b], in_lanes<Real>(model.body[b].centre))));
  }
  const auto geom_axis = work.geom_axes.template as<Vector3<Real>>();
  for (Index g = 0; g < model.geoms; ++g) {
    const auto& geom = model.geom[g];
    const Axes3<Real>& axes = work.axes[geom.body];
    const Axes3<Real> own = constant_axes<Real>(geom.axes);
    work.geom_position.put(g, added(work.position[geom.body], along(axes, in_lanes<Real>(geom.position))));
    geom_axis.put(3 * g + 2, along(axes, own.z));
    if (!has_three_axes(geom.kind)) continue;
    geom_axis.put(3 * g, along(axes, own.x));
    geom_axis.put(3 * g + 1, along(axes, own.y));
  }
}

}  // namespace stiction::inline STICTION_ISA
