#pragma once

#include "core/algorithm/rigid/evaluate_bodies.hpp"

/// Consensus ADMM between subdomains of one environment (docs/math/consensus.md; Boyd et al. 2011, section 7). A body
/// that several subdomains push has a copy in each. Copies are pulled to a common twist z by a penalty in the metric of
/// the body's own mass, and u are the scaled duals. All of it is in double, six numbers a twist.
namespace stiction::inline STICTION_ISA {

/// Over-relaxation of copies before they meet (Boyd et al. 2011, section 3.4.3).
inline constexpr double kConsensusRelaxation = 1.6;
/// Relaxation of rounds that do not wait for one another: their input may be old, so they step less far.
inline constexpr double kAsynchronousRelaxation = 1.0;
/// Rounds between two decisions: the residual of the whole environment, and the penalty.
inline constexpr Index kConsensusRounds = 4;
/// Rounds that a rank makes at most while another one makes those: the bound of a letter's age.
inline constexpr Index kAsynchronousRounds = 64;

/// A copy has 1/copies of the mass, and the penalty's share of it: its inverse mass is that many times the body's.
STICTION_HD double copy_gain(Index copies, double penalty) {
  return div_(static_cast<double>(copies), 1.0 + penalty);
}

template <class Real>
STICTION_HD void share_mass(double gain, Real own_mass, const Real* own_inertia, Real& mass, Real* inertia) {
  mass = saturated<Real>(gain * static_cast<double>(own_mass));
  for (Index k = 0; k < 6; ++k) inertia[k] = saturated<Real>(gain * static_cast<double>(own_inertia[k]));
}

/// Change of a copy's twist by forces and the pull to z - u: change + pull (z - u - free), pull = penalty / (1 +
/// penalty).
template <class Real>
STICTION_HD void pull_copy(const double* z, const double* u, const double* free, const double* change, double penalty,
                           Real* pulled) {
  const double pull = div_(penalty, 1.0 + penalty);
  for (Index k = 0; k < 6; ++k)
    pulled[k] = canonical_zero(saturated<Real>(fma_(pull, z[k] - u[k] - free[k], change[k])));
}

/// Adds a copy's share of the mean: its relaxed twist and its dual.
template <class Real>
STICTION_HD void ask_for(double relaxation, const Real* twist, const double* z, const double* u, double* asked) {
  for (Index k = 0; k < 6; ++k) asked[k] = fma_(relaxation, static_cast<double>(twist[k]) - z[k], z[k]) + u[k];
}

/// z: the mean of the copies' requests, in their order, six numbers after six.
STICTION_HD void mean_of(const double* asked, Index copies, double* z) {
  const double count(static_cast<double>(copies));
  for (Index k = 0; k < 6; ++k) {
    double sum = asked[k];
    for (Index copy = 1; copy < copies; ++copy) sum = sum + asked[6 * static_cast<Offset>(copy) + k];
    z[k] = div_(sum, count);
  }
}

/// d' M d for a body of that inverse mass; a body that nothing moves has none.
STICTION_HD double mass_square(const InverseMass<double>& inverse, const Twist<double>& d) {
  const Symmetric3<double>& i = inverse.inertia;
  const double xx = i.yy * i.zz - i.yz * i.yz, xy = i.xz * i.yz - i.xy * i.zz, xz = i.xy * i.yz - i.xz * i.yy;
  const double yy = i.xx * i.zz - i.xz * i.xz, yz = i.xy * i.xz - i.xx * i.yz, zz = i.xx * i.yy - i.xy * i.xy;
  const double determinant = i.xx * xx + i.xy * xy + i.xz * xz;
  const Vector3<double> zero{0.0, 0.0, 0.0};
  const double linear = dot(d.linear, d.linear);
  const double angular = dot(d.angular, add_product(zero, Symmetric3<double>{xx, xy, xz, yy, yz, zz}, d.angular));
  const double moved = inverse.mass > 0.0 ? div_(linear, inverse.mass) : 0.0 * linear;
  return moved + (determinant > 0.0 ? div_(angular, determinant) : 0.0 * angular);
}

/// Distance of copies from agreement, squared, in the metric of their masses [J].
struct ConsensusGap {
  double primal = 0.0;  ///< of twists from z
  double dual = 0.0;    ///< of z from the z before
};

STICTION_HD void add_gap(ConsensusGap& gap, const ConsensusGap& more) {
  gap.primal = gap.primal + more.primal;
  gap.dual = gap.dual + more.dual;
}

/// Takes the new mean: the dual becomes the excess of the request. `before` is the mean before. Adds the copy's
/// gaps.
template <class Real>
STICTION_HD void settle_copy(const InverseMass<double>& inverse, Index copies, const Real* twist, const double* asked,
                             const double* mean, const double* before, double* dual, ConsensusGap& gap) {
  double apart[6];
  double moved[6];
  for (Index k = 0; k < 6; ++k) {
    dual[k] = asked[k] - mean[k];
    apart[k] = static_cast<double>(twist[k]) - mean[k];
    moved[k] = mean[k] - before[k];
  }
  const double count(static_cast<double>(copies));
  add_gap(gap, {div_(mass_square(inverse, twist_at<double>(apart)), count),
                div_(mass_square(inverse, twist_at<double>(moved)), count)});
}

/// The gap that one of `rounds` rounds would have made: z has moved in all of them, copies are apart after one.
STICTION_HD ConsensusGap gap_of_one_round(const ConsensusGap& gap, double rounds) {
  return {gap.primal, div_(gap.dual, rounds * rounds)};
}

/// Returns the factor of the penalty, a power of two (He, Yang, Wang 2000; Boyd et al. 2011, section 3.4.1). Gaps are
/// squares: a hundredfold one is a tenfold distance.
STICTION_HD double penalty_factor(const ConsensusGap& gap, double penalty) {
  const double dual = penalty * penalty * gap.dual;
  if (gap.primal > 100.0 * dual && penalty < 0x1p20) return 2.0;
  if (dual > 100.0 * gap.primal && penalty > 0x1p-10) return 0.5;
  return 1.0;
}

/// Scaled duals of another penalty.
STICTION_HD void scale_dual(double factor, double* u) {
  for (Index k = 0; k < 6; ++k) u[k] = div_(u[k], factor);
}

/// Scales a copy's request to duals of another penalty.
STICTION_HD void scale_asked(double factor, const double* z, const double* was, double* asked) {
  for (Index k = 0; k < 6; ++k) asked[k] = z[k] + div_(was[k] - z[k], factor);
}

/// The twist of a body after the step without reactions, from its own numbers.
template <class Real>
STICTION_HD void free_twist_of(const BodyEnv<Real>& env, Index body, double* change, double* free) {
  const Offset row = 6 * static_cast<Offset>(body);
  for (Index k = 0; k < 6; ++k) {
    const bool is_moved = env.twist_change != nullptr && !env.is_kinematic(body);
    change[k] = is_moved ? static_cast<double>(env.twist_change[row + k]) : 0.0;
    free[k] = static_cast<double>(env.twist[row + k]) + change[k];
  }
}

/// Computes a body's change of twist by the environment's impulses, M^-1 J' lambda in double.
template <class Real>
STICTION_HD void pushed_change(const BodyEnv<Real>& env, Index body, const Real* impulse, double* change) {
  const Twist<double> none{{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  put_twist(change,
            gather_impulses(env, body, none, exact_mass(env, body), [&](Index p, bool is_b, Vector3<double>& arm) {
              const ExactContact contact = exact_contact(env, p);
              arm = is_b ? contact.arm_b : contact.arm_a;
              const Vector3<double> lambda = load3<double>(impulse + 3 * static_cast<Offset>(contact.contact));
              return to_world(contact.frame, lambda.x, lambda.y, lambda.z);
            }));
}

/// The twist of a body: free, and its changes by the impulses of each of its copies, in their order.
STICTION_HD void sum_changes(const double* changes, Index copies, const double* free, double* twist) {
  for (Index k = 0; k < 6; ++k) {
    double sum = free[k];
    for (Index copy = 0; copy < copies; ++copy) sum = sum + changes[6 * static_cast<Offset>(copy) + k];
    twist[k] = sum;
  }
}

/// The twist at `slot` of rows of six numbers; that of the world.
template <class Numbers>
STICTION_HD Twist<double> twist_in(const Numbers* rows, Index slot, Index bodies) {
  if (slot >= bodies) return {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  return twist_at<double>(rows + 6 * static_cast<Offset>(slot));
}

/// Judges one contact with twists under all impulses, six numbers a body (docs/math/residual.md).
template <Law kLaw, class Real>
STICTION_HD void judge_contact(const BodyEnv<Real>& env, const SiParams& params, Index p, const Real* impulse,
                               const double* twists, double unit, LargestResidual<double>& evaluated) {
  const ExactContact contact = exact_contact(env, p);
  const Offset row = contact.contact;
  double lambda[3];
  for (Index k = 0; k < 3; ++k) lambda[k] = static_cast<double>(impulse[3 * row + k]);
  double motion[3];
  const auto side = [&](int k) { return k == 0 ? contact.side_a : contact.side_b; };
  const auto start = [&](int k) { return twist_in(env.twist, slot_of(side(k)), env.bodies); };
  evaluate_contact<kLaw, double>(
      contact, [&](int k) { return twist_in(twists, slot_of(side(k)), env.bodies); },
      [&](int k) { return exact_mass(env, side(k)); },
      [&] {
        return bias_of<double>(params, contact, start(0), start(1), static_cast<double>(env.depth[row]),
                               static_cast<double>(env.restitution[row]));
      },
      static_cast<double>(env.mu[row]), div_(params.cfm, params.step), lambda, motion, 1.0, unit, evaluated);
}

/// Judges all contacts of an environment with twists under the impulses of all environments that share its bodies.
template <Law kLaw, class Real>
STICTION_HD void evaluate_subdomain(const BodyEnv<Real>& env, const SiParams& params, const Real* impulse,
                                    const double* twists, double unit, LargestResidual<double>& evaluated) {
  for (Index p = 0; p < env.kept; ++p) judge_contact<kLaw>(env, params, p, impulse, twists, unit, evaluated);
}

/// The largest error that a contact of an environment has without reactions, or `largest` [w]. Parts of an environment
/// do not know its islands. They search as if it were one, and the answer is judged where all of it is known.
template <Law kLaw, class Real>
STICTION_HD double largest_error_at_rest(const BodyEnv<Real>& env, const SiParams& params, double largest) {
  const auto free = [&](Index side) {
    const Index slot = slot_of(side);
    if (slot >= env.bodies) return Twist<double>{{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    double change[6];
    double twist[6];
    free_twist_of(env, slot, change, twist);
    return twist_at<double>(twist);
  };
  for (Index p = 0; p < env.kept; ++p) {
    const ExactContact contact = exact_contact(env, p);
    const auto start = [&](Index side) { return twist_in(env.twist, slot_of(side), env.bodies); };
    const double bias = bias_of<double>(params, contact, start(contact.side_a), start(contact.side_b),
                                        static_cast<double>(env.depth[contact.contact]),
                                        static_cast<double>(env.restitution[contact.contact]));
    double b[3];
    free_motion<double>(contact, free(contact.side_a), free(contact.side_b), bias, b);
    ContactBlock<double> block{0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    add_body(block, exact_mass(env, contact.side_a), contact.arm_a, contact.frame);
    add_body(block, exact_mass(env, contact.side_b), contact.arm_b, contact.frame);
    const double r = div_(params.cfm, params.step), a = max_(block.nn + r, 0.0);
    const double mu = static_cast<double>(env.mu[contact.contact]);
    const auto metric =
        contact_metric(a, axis_weights(a, block.t11 + r, mu).press, axis_weights(a, block.t22 + r, mu).press);
    largest = max_(error_at_rest<kLaw>(b, mu, metric, 1.0), largest);
  }
  return largest;
}

}  // namespace stiction::inline STICTION_ISA
