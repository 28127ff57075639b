#pragma once

#include "core/algorithm/linear/block/block_product.hpp"
#include "core/algorithm/linear/multigrid/prolongation.hpp"
#include "core/algorithm/rigid/consensus.hpp"
#include "core/algorithm/rigid/newton/newton_bodies.hpp"

/// Newton's method in body space, a contact and a body at a time, for ranks that each have some of them
/// (docs/math/domain_newton.md). What it computes is what newton_bodies.hpp does; sums and maxima are the caller's.
namespace stiction::inline STICTION_ISA {

/// sum + v'w over the six numbers of a body.
STICTION_HD double add_dot(double sum, const double* v, const double* w) {
  for (Index k = 0; k < kBodyBlock; ++k) sum = fma_(v[k], w[k], sum);
  return sum;
}

/// R.
STICTION_HD double compliance_of(const SiParams& params) {
  return div_(params.cfm, params.step);
}

/// J v_free + bias of a contact, from twists that forces alone lead to, six numbers a body.
template <class Real>
STICTION_HD void load_free_motion(const BodyEnv<Real>& env, const SiParams& params, Index p, const double* free,
                                  SpaceContact& contact) {
  const ExactContact exact = exact_contact(env, p);
  const auto start = [&](Index side) { return twist_in(env.twist, slot_of(side), env.bodies); };
  const auto moving = [&](Index side) { return twist_in(free, slot_of(side), env.bodies); };
  const Vector3<double> u = relative_velocity(moving(exact.side_a), exact.arm_a, moving(exact.side_b), exact.arm_b);
  const double bias = bias_of<double>(params, exact, start(exact.side_a), start(exact.side_b),
                                      static_cast<double>(env.depth[exact.contact]),
                                      static_cast<double>(env.restitution[exact.contact]));
  contact.free[0] = dot(u, contact.frame.n) + bias;
  contact.free[1] = dot(u, contact.frame.t1);
  contact.free[2] = dot(u, contact.frame.t2);
  contact.shift = 0.0;
}

/// A body's p under the impulses that are the centres of its contacts.
STICTION_HD void start_body(const SpaceWorkspace& workspace, Index row) {
  const Twist<double> wrench =
      gather_wrench(workspace, row, [](const SpaceContact& contact) { return contact.prox_center; });
  const Twist<double> still{{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  put_twist(workspace.point + static_cast<Offset>(row) * kBodyBlock,
            pushed(still, workspace.body[row].inverse, wrench.linear, wrench.angular));
}

/// A contact's motion at workspace.point, and under Coulomb's law its shift there.
STICTION_HD void start_contact(const SpaceWorkspace& workspace, SpaceContact& contact, double compliance) {
  double u[3];
  relative_motion(contact, workspace.point, u);
  for (int k = 0; k < 3; ++k) contact.u[k] = u[k] + contact.free[k];
  if (workspace.law == Law::convex) return;
  double slide[3];
  for (int k = 1; k < 3; ++k) slide[k] = fma_(compliance, contact.prox_center[k], contact.u[k]);
  contact.shift = contact.mu * sqrt_(fma_(slide[2], slide[2], slide[1] * slide[1]));
  contact.u[0] = contact.u[0] + contact.shift;
}

/// The reaction to a contact's motion, and what its shift would be.
STICTION_HD void answer_motion(SpaceContact& contact, Law law, double compliance) {
  unprojected(contact, contact.u, compliance, contact.z);
  const ConePoint point = project_friction_cone(contact.z, contact.mu);
  double slide[3];
  for (int k = 0; k < 3; ++k) {
    contact.reaction[k] = point.x[k];
    slide[k] = fma_(compliance, point.x[k], contact.u[k]);
  }
  const bool is_held = point.P[1][1] + point.P[2][2] == 2.0;
  contact.sliding =
      is_held || law == Law::convex ? 0.0 : contact.mu * sqrt_(fma_(slide[2], slide[2], slide[1] * slide[1]));
}

/// Minus a body's part of the gradient, as a twist and as a force.
STICTION_HD void renew_descent_of(const SpaceWorkspace& workspace, Index row) {
  const Twist<double> p = SpaceWorkspace::twist(workspace.point, row);
  const Twist<double> wrench =
      gather_wrench(workspace, row, [](const SpaceContact& contact) { return contact.reaction; });
  const Twist<double> still{{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  const Twist<double> moved = pushed(still, workspace.body[row].inverse, wrench.linear, wrench.angular);
  const Twist<double> descent{subtract(moved.linear, p.linear), subtract(moved.angular, p.angular)};
  put_twist(workspace.descent + static_cast<Offset>(row) * kBodyBlock, descent);
  put_twist(workspace.force + static_cast<Offset>(row) * kBodyBlock, momentum_of(workspace.body[row], descent));
}

/// The largest component of a contact's motion under those twists [w], or `largest`.
STICTION_HD double largest_motion(const SpaceContact& contact, const double* twists, double largest) {
  double change[3];
  relative_motion(contact, twists, change);
  for (int k = 0; k < 3; ++k) largest = max_(abs_(change[k]), largest);
  return largest;
}

/// The residual that a linear system may keep, from the energy of the gradient; the largest energy is remembered.
STICTION_HD double linear_tolerance(double energy, SpaceProgress& progress) {
  energy = max_(energy, 0.0);
  progress.reference = max_(energy, progress.reference);
  const double part = progress.reference > 0.0 ? div_(energy, progress.reference) : 1.0;
  return min_(0.1, 0.5 * sqrt_(sqrt_(part)));
}

/// The weight of the next problem.
STICTION_HD void fall_weight(SpaceProgress& progress) {
  progress.prox_weight = max_(kProxWeightFall * progress.prox_weight, progress.prox_weight_end);
  if (progress.prox_weight_end == 0.0 && progress.prox_weight < kEnoughCompliance) progress.prox_weight = 0.0;
  progress.reference = 0.0;
  progress.inner_steps = 0;
}

/// W of a contact as it is held, slides or is open.
STICTION_HD void turn_curvature(SpaceContact& contact, double compliance) {
  turn_stiffness(contact, project_friction_cone(contact.z, contact.mu).P, div_(1.0, compliance + contact.prox_weight));
}

/// d'Md of one body.
STICTION_HD double curvature_of_body(const SpaceWorkspace& workspace, Index row) {
  const Twist<double> d = SpaceWorkspace::twist(workspace.step, row);
  const Twist<double> momentum = momentum_of(workspace.body[row], d);
  return dot(momentum.linear, d.linear) + dot(momentum.angular, d.angular);
}

/// What a contact adds to slope and curvature at a place of the line.
STICTION_HD LinePoint look_along(const SpaceContact& contact, double compliance, double alpha) {
  double u[3];
  for (int k = 0; k < 3; ++k) u[k] = fma_(alpha, contact.along[k], contact.u[k]);
  double z[3];
  unprojected(contact, u, compliance, z);
  const ConePoint point = project_friction_cone(z, contact.mu);
  LinePoint part{0.0, 0.0};
  for (int i = 0; i < 3; ++i) {
    double image = 0.0;
    for (int j = 0; j < 3; ++j) image = fma_(point.P[i][j], contact.along[j], image);
    part.slope = fma_(0.0 - contact.along[i], point.x[i], part.slope);
    part.curvature = fma_(contact.along[i], image, part.curvature);
  }
  part.curvature = div_(part.curvature, compliance + contact.prox_weight);
  return part;
}

/// The magnitudes that a contact's part of a slope is made of; 4 eps of their sum is what rounding makes of it.
STICTION_HD double slope_terms(const SpaceContact& contact, double compliance) {
  double sum = 0.0;
  for (int k = 0; k < 3; ++k) {
    const double answer = abs_(contact.reaction[k]) + div_(abs_(contact.u[k]), compliance + contact.prox_weight);
    sum = fma_(abs_(contact.along[k]), answer, sum);
  }
  return sum;
}

/// Slope and curvature at a place of the line: what bodies have at 0, and what contacts have there.
STICTION_HD LinePoint at_place(const LinePoint& bodies, const LinePoint& contacts, double alpha) {
  return {fma_(alpha, bodies.curvature, bodies.slope) + contacts.slope, bodies.curvature + contacts.curvature};
}

/// A contact's motion at the end of the line, and one number of a body.
STICTION_HD void follow_line(SpaceContact& contact, double alpha) {
  for (int k = 0; k < 3; ++k) contact.u[k] = fma_(alpha, contact.along[k], contact.u[k]);
}
STICTION_HD double follow_line(double from, double step, double alpha) {
  return fma_(alpha, step, from);
}

/// Before the system of (6) or (7) is solved: the reaction without a change of velocities, and W.
STICTION_HD void prepare_renewal(SpaceContact& contact, double compliance, bool with_sliding) {
  const FollowedContact followed = followed_contact(contact, compliance, with_sliding);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) contact.reaction[i] = fma_(followed.P[i][j], followed.first[j], contact.reaction[i]);
  if (with_sliding) turn_followed_stiffness(contact, followed);
}

/// After it is: the motion and the shift that follow workspace.step.
STICTION_HD void finish_renewal(const SpaceWorkspace& workspace, SpaceContact& contact, double compliance,
                                bool with_sliding) {
  const double before = contact.shift;
  double d[3];
  relative_motion(contact, workspace.step, d);
  contact.shift = with_sliding && contact.sliding > 0.0
                      ? followed_shift(contact, followed_contact(contact, compliance, with_sliding), compliance, d)
                      : contact.sliding;
  for (int k = 0; k < 3; ++k) contact.u[k] = contact.u[k] + d[k];
  contact.u[0] = contact.u[0] + (contact.shift - before);
}

/// A block above the diagonal from its transpose, so that H is symmetric to the last bit.
STICTION_HD void mirror_block(const double* lower, double* upper) {
  for (Index i = 0; i < kBodyBlock; ++i)
    for (Index j = 0; j < kBodyBlock; ++j) upper[i * kBodyBlock + j] = lower[j * kBodyBlock + i];
}

/// A block of H at or below the diagonal; what is above it in the diagonal block mirrors what is below.
STICTION_HD void assemble_lower_block(const SpaceWorkspace& workspace, Index row, Index k) {
  double* const sum = workspace.H.block(k);
  assemble_block(workspace, row, k, sum);
  if (workspace.stream.pattern.columns[k] != row) return;
  for (Index i = 0; i < kBodyBlock; ++i)
    for (Index j = 0; j < i; ++j) sum[j * kBodyBlock + i] = sum[i * kBodyBlock + j];
}

/// coarse = coarse + T_i' K T_j for rigid motions T of two bodies, each about its aggregate's root.
STICTION_HD void add_coarse_block(const double (&left)[kBlockEntries], const double* K,
                                  const double (&right)[kBlockEntries], double* coarse) {
  double product[kBlockEntries] = {};
  add_block_product<false>(K, right, product);
  add_block_product<true>(left, product, coarse);
}

/// sum = sum + T' force of one body.
STICTION_HD void restrict_to_root(const double* position, const double* root, const double* force,
                                  double (&sum)[kBodyBlock]) {
  double T[kBlockEntries];
  rigid_block(position, root, T);
  multiply_transposed_block(T, force, sum);
}

/// twist = twist + T coarse.
STICTION_HD void move_with_root(const double* position, const double* root, const double* coarse,
                                double (&twist)[kBodyBlock]) {
  double T[kBlockEntries];
  rigid_block(position, root, T);
  multiply_block(T, coarse, twist);
}

}  // namespace stiction::inline STICTION_ISA
