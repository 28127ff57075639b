#pragma once

#include "core/algorithm/linear/block/block_product.hpp"
#include "core/algorithm/linear/multigrid/prolongation.hpp"
#include "core/algorithm/rigid/consensus.hpp"
#include "core/algorithm/rigid/newton/newton_bodies.hpp"

/// Newton's method in body space, a contact and a body at a time, for ranks that each have some of them
/// (docs/math/domain_newton.md). Its arithmetic is that of newton_bodies.hpp; sums and maxima are the caller's.
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

/// `largest`, or the largest component of a contact's motion under those twists where that is larger [w].
STICTION_HD double larger_motion(const SpaceContact& contact, const double* twists, double largest) {
  return max_(largest_motion(contact, twists), largest);
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
