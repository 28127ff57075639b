#pragma once

#include "core/algorithm/collision/manifold.hpp"
#include "core/algorithm/rigid/contact_point.hpp"
#include "core/team/phases.hpp"

/// Shapes where a step begins, and whether two of them are near.
namespace stiction::inline STICTION_ISA {

/// A shape where it is, and how far its surface may come within a step.
template <class Real>
struct MovingShape {
  PlacedShape<Real> placed;
  Real bound;   ///< of WorldShapeData
  Real travel;  ///< bound on the path of its points within a step [m]
};

template <class Real>
STICTION_HD Twist<Real> twist_of(const Real* p) {
  return {load3<Real>(p), load3<Real>(p + 3)};
}

/// Twist a body would have after the step without contacts.
template <class Real>
STICTION_HD Twist<Real> free_twist(const WorldJob<Real>& job, Offset body) {
  const Twist<Real> now = twist_of(job.twist + 6 * body);
  const Twist<Real> change = twist_of(job.twist_change + 6 * body);
  return {added(now.linear, change.linear), added(now.angular, change.angular)};
}

template <class Real>
STICTION_HD MovingShape<Real> pose_shape(const WorldJob<Real>& job, Offset env, Index shape) {
  const WorldShapeData<Real>& data = job.model.shape[shape];
  MovingShape<Real> moving{{data.kind,
                            load3<Real>(data.position),
                            {load3<Real>(data.axes), load3<Real>(data.axes + 3), load3<Real>(data.axes + 6)},
                            {data.size[0], data.size[1], data.size[2]}},
                           data.bound,
                           Real(0)};
  if (data.body < 0) return moving;
  const Offset body = env * job.model.bodies + data.body;
  const Axes3<Real> axes = axes_of(load_quaternion(job.orientation + 4 * body));
  PlacedShape<Real>& placed = moving.placed;
  placed.centre = added(load3<Real>(job.position + 3 * body), along(axes, placed.centre));
  placed.axes = {along(axes, placed.axes.x), along(axes, placed.axes.y), along(axes, placed.axes.z)};
  const Twist<Real> twist = free_twist(job, body);
  moving.travel = job.model.step * fma_(length(twist.angular), data.reach, length(twist.linear));
  return moving;
}

/// Puts all shapes where they are.
template <Team TeamT, class Real>
STICTION_HD void pose_shapes(TeamT& team, const WorldJob<Real>& job, Offset env, MovingShape<Real>* shape) {
  for_each(team, job.model.shapes, [&](Index k) { shape[k] = pose_shape(job, env, k); });
}

/// Gap up to which two shapes may become a contact.
template <class Real>
STICTION_HD Real pair_margin(const WorldModelView<Real>& model, const MovingShape<Real>& a,
                             const MovingShape<Real>& b) {
  return model.margin + (a.travel + b.travel);
}

/// Returns true if two shapes are near enough to look closer.
template <class Real>
STICTION_HD bool bounds_overlap(const MovingShape<Real>& a, const MovingShape<Real>& b, Real margin) {
  const Vector3<Real> apart = subtract(b.placed.centre, a.placed.centre);
  const Real reach = (a.bound + b.bound) + margin;
  if (a.placed.kind == ShapeKind::plane) return dot(apart, a.placed.axes.z) <= reach;
  if (b.placed.kind == ShapeKind::plane) return -dot(apart, b.placed.axes.z) <= reach;
  return dot(apart, apart) <= reach * reach;
}

}  // namespace stiction::inline STICTION_ISA
