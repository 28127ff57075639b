#pragma once

#include "core/algorithm/articulated/constants.hpp"

/// Inertias about the centres of trees, and M by composite rigid bodies (R. Featherstone, Rigid Body Dynamics
/// Algorithms, 2008, chapter 6).
namespace stiction::inline STICTION_ISA {

/// Centres of mass of whole trees.
template <class Real, int kStride>
STICTION_HD void find_tree_centres(const Robots<Real, kStride>& robots) {
  const auto& model = robots.model;
  auto& work = robots.work;
  for (Index b = 1; b < model.bodies; ++b) {
    const auto& body = model.body[b];
    const Vector3<Real> base = body.root == b ? no_vector<Real>() : work.tree_centre[body.root];
    work.tree_centre.put(body.root, add_scaled(base, mass_of(robots, b), work.centre[b]));
  }
  for (Index b = 1; b < model.bodies; ++b) {
    const auto& body = model.body[b];
    if (body.root != b) continue;
    const Real mass = subtree_mass_of(robots, b);
    const Mask<Real> has_mass = mass > Real(0);
    const Real divisor = select(has_mass, mass, Real(1));
    const Vector3<Real>& sum = work.tree_centre[b];
    const Vector3<Real>& own = work.centre[b];
    work.tree_centre.put(b,
                         {select(has_mass, div_(sum.x, divisor), own.x), select(has_mass, div_(sum.y, divisor), own.y),
                          select(has_mass, div_(sum.z, divisor), own.z)});
  }
}

template <class Real, int kStride>
STICTION_HD SpatialInertia<Real> inertia_of(const Robots<Real, kStride>& robots, Index b) {
  const auto& body = robots.model.body[b];
  const auto& work = robots.work;
  const Vector3<Real> offset = subtract(work.centre[b], work.tree_centre[body.root]);
  const Vector3<Real> moment = scaled(mass_of(robots, b), offset);
  const Real xx = offset.x * moment.x, yy = offset.y * moment.y, zz = offset.z * moment.z;
  const Real round = round_inertia_of(robots, b);
  Symmetric3<Real> about{round + (yy + zz), -(offset.x * moment.y), -(offset.x * moment.z),
                         round + (xx + zz), -(offset.y * moment.z), round + (xx + yy)};
  for (Index k = 0; k < body.more_axes; ++k) {
    const Vector3<Real> a = along(work.axes[b], in_lanes<Real>(body.axis[k]));
    const Vector3<Real> more = scaled(more_inertia_of(robots, b, k), a);
    about.xx = fma_(a.x, more.x, about.xx);
    about.xy = fma_(a.y, more.x, about.xy);
    about.xz = fma_(a.z, more.x, about.xz);
    about.yy = fma_(a.y, more.y, about.yy);
    about.yz = fma_(a.z, more.y, about.yz);
    about.zz = fma_(a.z, more.z, about.zz);
  }
  return {about, moment};
}

/// A rotation about an axis through an anchor, as a motion about the tree's centre.
template <class Real>
STICTION_HD Twist<Real> rotation_about(const Vector3<Real>& axis, const Vector3<Real>& arm) {
  return {cross(axis, arm), axis};
}

/// Motions that a joint's degrees of freedom make.
template <class Real, int kStride>
STICTION_HD void find_motions(const Robots<Real, kStride>& robots, Index j) {
  const auto& joint = robots.model.joint[j];
  const auto& work = robots.work;
  const auto& motion = work.motion;
  Index dof = joint.dof;
  if (joint.kind == JointKind::slide) {
    motion.put(dof, {work.axis[j], no_vector<Real>()});
    return;
  }
  const Vector3<Real> arm = subtract(work.tree_centre[robots.model.body[joint.body].root], work.anchor[j]);
  if (joint.kind == JointKind::hinge) {
    motion.put(dof, rotation_about(work.axis[j], arm));
    return;
  }
  if (joint.kind == JointKind::free) {
    const Vector3<Real> none = no_vector<Real>();
    motion.put(dof++, {{Real(1), Real(0), Real(0)}, none});
    motion.put(dof++, {{Real(0), Real(1), Real(0)}, none});
    motion.put(dof++, {{Real(0), Real(0), Real(1)}, none});
  }
  const Axes3<Real>& axes = work.axes[joint.body];
  motion.put(dof, rotation_about(axes.x, arm));
  motion.put(dof + 1, rotation_about(axes.y, arm));
  motion.put(dof + 2, rotation_about(axes.z, arm));
}

template <class Real, int kStride>
STICTION_HD_OUTLINE void find_inertias(const Robots<Real, kStride>& robots) {
  find_tree_centres(robots);
  for (Index b = 1; b < robots.model.bodies; ++b) robots.work.inertia.put(b, inertia_of(robots, b));
  for (Index j = 0; j < robots.model.joints; ++j) find_motions(robots, j);
}

/// Force times the motion of a degree of freedom, of whose parts none is multiplied that the model knows.
template <class Real, int kStride>
STICTION_HD Real force_along(const Robots<Real, kStride>& robots, Index dof, const Twist<Real>& force) {
  switch (robots.model.dof[dof].kind) {
    case DofKind::x:
      return force.linear.x;
    case DofKind::y:
      return force.linear.y;
    case DofKind::z:
      return force.linear.z;
    case DofKind::slide:
      return dot(robots.work.motion[dof].linear, force.linear);
    default:
      return dot(robots.work.motion[dof], force);
  }
}

/// M in the tree's envelope.
template <class Real, int kStride>
STICTION_HD_OUTLINE void find_mass_matrix(const Robots<Real, kStride>& robots) {
  const auto& model = robots.model;
  auto& work = robots.work;
  for (Index b = 1; b < model.bodies; ++b) work.composite.put(b, work.inertia[b]);
  for (Index b = model.bodies - 1; b > 0; --b) {
    const Index parent = model.body[b].parent;
    if (parent == 0) continue;
    const SpatialInertia<Real>& from = work.composite[b];
    const SpatialInertia<Real>& to = work.composite[parent];
    const Symmetric3<Real>&s = from.about, &t = to.about;
    work.composite.put(parent, {{t.xx + s.xx, t.xy + s.xy, t.xz + s.xz, t.yy + s.yy, t.yz + s.yz, t.zz + s.zz},
                                added(to.moment, from.moment)});
  }
  for (Index k = 0; k < model.dof_count; ++k) {
    const Index b = model.dof[k].body;
    const Twist<Real> force = momentum(work.composite[b], subtree_mass_of(robots, b), work.motion[k]);
    const auto row = work.M.from(robots.tree.begin[k]);
    const auto* const path = robots.tree.path(k);
    const Index own = robots.tree.depth[k];
    for (Index d = 0; d <= own; ++d) row[d] = force_along(robots, path[d], force);
    row[own] = row[own] + armature_of(robots, k);
  }
}

/// Factors M, or M with damping and braking over a step. Returns the lanes in which it is positive definite.
template <class Real, int kStride>
STICTION_HD Mask<Real> factor_masses(const Robots<Real, kStride>& robots, const RobotNumbers<Real, kStride>& factor,
                                     const RobotNumbers<Real, kStride>& inverse, bool is_damped) {
  const auto& work = robots.work;
  SerialTeam team;
  for (Index e = 0; e < robots.tree.entries; ++e) factor[e] = work.M[e];
  if (is_damped)
    for (Index k = 0; k < robots.model.dof_count; ++k) {
      Real& diagonal = factor[robots.tree.diagonal(k)];
      if (robots.model.damps_implicitly) diagonal = diagonal + step_damping_of(robots, k);
      if (work.braking.data != nullptr) diagonal = fma_(Real(robots.model.step), work.braking[k], diagonal);
    }
  return factor_tree(team, robots.tree, factor.numbers(), inverse.numbers());
}
template <class Real, int kStride>
STICTION_HD void solve_masses(const Robots<Real, kStride>& robots, const RobotNumbers<Real, kStride>& factor,
                              const RobotNumbers<Real, kStride>& inverse, const RobotNumbers<Real, kStride>& x) {
  SerialTeam team;
  solve_tree(team, robots.tree, factor.numbers(), inverse.numbers(), x.numbers());
}

}  // namespace stiction::inline STICTION_ISA
