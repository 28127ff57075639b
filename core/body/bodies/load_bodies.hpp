#pragma once

#include "core/body/bodies/si_sweep.hpp"
#include "core/body/prepare_body.hpp"

/// From the batch's arrays to a system that can be swept.
namespace stiction::inline STICTION_ISA {

template <class Real>
STICTION_HD bool all_finite(const Real* values, Index count) {
  bool finite = true;
  for (Index k = 0; k < count; ++k) finite = finite && finite_(values[k]);
  return finite;
}

/// EnvFlag bits of an environment's own numbers, before anything is projected: a projection would hide a NaN.
template <Block B, class Real>
STICTION_HD_OUTLINE std::uint32_t inspect_bodies(B& block, const BodyEnv<Real>& env) {
  std::uint32_t flags = env.kept < env.contacts ? kFlagCapacity : 0U;
  for (Index body = block.rank(); body < env.bodies; body += block.size()) {
    const Offset row = 6 * static_cast<Offset>(body);
    bool finite = all_finite(env.twist + row, 6);
    if (!env.is_kinematic(body)) {
      finite = finite && finite_(env.inv_mass[body]) && all_finite(env.inv_inertia + row, 6);
      if (env.twist_change != nullptr) finite = finite && all_finite(env.twist_change + row, 6);
      if (env.inv_mass[body] < Real(0)) flags |= kFlagBadMass;
    }
    if (!finite) flags |= kFlagNonFiniteInput;
  }
  for (Index c = block.rank(); c < env.contacts; c += block.size()) {
    const Offset row = 3 * static_cast<Offset>(c);
    const bool finite = all_finite(env.arm_a + row, 3) && all_finite(env.arm_b + row, 3) &&
                        all_finite(env.normal + row, 3) && finite_(env.mu[c]) && finite_(env.depth[c]) &&
                        finite_(env.restitution[c]);
    if (!finite) flags |= kFlagNonFiniteInput;
    if (env.mu[c] < Real(0)) flags |= kFlagNegativeFriction;
    if (env.warm_start != nullptr && !all_finite(env.warm_start + row, 3)) flags |= kFlagWarmStartRejected;
  }
  return block.combine(flags);
}

/// Whether a body environment with those flags can be solved.
STICTION_HD bool can_sweep(std::uint32_t flags) {
  return (flags & ~static_cast<std::uint32_t>(kFlagWarmStartRejected | kFlagCapacity)) == 0;
}

template <Block B, class Real, Law kLaw, int kStride>
STICTION_HD void load_masses(B& block, const BodyEnv<Real>& env, const BodySystem<Real, kLaw, kStride>& s) {
  for_each(block, s.bodies + 1, [&](Index body) {
    const bool world = body == s.bodies;
    const bool pushed = !world && !env.is_kinematic(body);
    const auto mass = s.mass_row(body);
    const auto start = s.twist_row(s.start, body);
    const auto motion = s.twist_row(s.motion, body);
    mass[0] = pushed ? env.inv_mass[body] : Real(0);
    for (Index k = 0; k < 6; ++k) {
      const Offset place = 6 * static_cast<Offset>(body) + k;
      mass[1 + k] = pushed ? env.inv_inertia[place] : Real(0);
      start[k] = motion[k] = world ? Real(0) : env.twist[place];
      if (s.has_momentum()) s.twist_row(s.motion_before, body)[k] = motion[k];
    }
  });
}

/// A contact's block in the solver's coordinates, as the bounds on its eigenvalues read a system.
template <class RealType>
struct OneBlock {
  using Real = RealType;
  Real block[3][3];
  [[nodiscard]] STICTION_HD Real block_entry(Index, Index i, Index j) const { return block[i][j]; }
};

/// The constants of a contact's local problem, and whether it can be solved.
template <class Real, Law kLaw, int kStride>
STICTION_HD bool load_block(const BodySystem<Real, kLaw, kStride>& s, Index p, const ContactBlock<Real>& block,
                            Real mu) {
  const Real r = s.compliance;
  OneBlock<Real> one;
  one.block[0][0] = block.nn + r;
  one.block[1][0] = one.block[0][1] = mu * block.n1;
  one.block[2][0] = one.block[0][2] = mu * block.n2;
  one.block[1][1] = mu * mu * (block.t11 + r);
  one.block[1][2] = one.block[2][1] = mu * mu * block.t12;
  one.block[2][2] = mu * mu * (block.t22 + r);
  const Real normal = one.block[0][0];
  const Real whole = largest_eigenvalue_bound<3, 0>(one, 0);
  const Real tangential = max_(largest_eigenvalue_bound<3, 1>(one, 0), whole * Real(kSmallestTangential));
  const Real inv_n = inverse_of_positive(normal);
  const Real inv_t = inverse_of_positive(tangential);
  s.field.at(kFieldInverse, p) = inv_n;
  s.field.at(kFieldInverse + 1, p) = inv_t;
  if constexpr (kLaw == Law::coulomb) {
    s.field.at(kFieldBlock, p) = one.block[1][0];
    s.field.at(kFieldBlock + 1, p) = one.block[2][0];
  } else {
    const BlockMetric<Real> metric = block_metric<3>(one, 0, inv_n, inv_t);
    s.field.at(kFieldBlock, p) = metric.damping;
    s.field.at(kFieldBlock + 1, p) = metric.share;
    Index field = kFieldBlock + 2;
    for (int i = 0; i < 3; ++i)
      for (int j = i; j < 3; ++j) s.field.at(field++, p) = one.block[i][j];
  }
  const Real sum = (block.nn + r) + (block.t11 + r) + (block.t22 + r);
  s.field.at(kFieldWeight, p) = div_(sum, Real(3));
  return normal > Real(0) && block.t11 + r >= Real(0) && block.t22 + r >= Real(0);
}

/// A contact's first iterate: the share of one sub-step of its warm start, on its cone.
template <class Real, Law kLaw, int kStride>
STICTION_HD void load_impulse(const BodyEnv<Real>& env, const BodySystem<Real, kLaw, kStride>& s,
                              const SiParams& params, Index p, Index contact, Real mu, bool warm) {
  Real z[3] = {Real(0), Real(0), Real(0)};
  if (warm) {
    const Real share = static_cast<Real>(div_(1.0, static_cast<double>(params.substeps)));
    const Real* impulse = env.warm_start + 3 * static_cast<Offset>(contact);
    z[0] = impulse[0] * share;
    for (int k = 1; k < 3; ++k) z[k] = mu > Real(0) ? div_(impulse[k] * share, mu) : Real(0);
    project_second_order_cone<3>(z);
  }
  for (int k = 0; k < 3; ++k) s.x.at(k, p) = canonical_zero(z[k]);
}

/// Fills a system with everything but what a sub-step changes. Returns the flags.
template <Block B, class Real, Law kLaw, int kStride>
STICTION_HD std::uint32_t load_bodies(B& block, const BodyEnv<Real>& env, const BodySystem<Real, kLaw, kStride>& s,
                                      const SiParams& params) {
  std::uint32_t flags = inspect_bodies(block, env);
  if (!can_sweep(flags)) return flags;
  const bool warm = env.warm_start != nullptr && (flags & kFlagWarmStartRejected) == 0;
  load_masses(block, env, s);
  std::uint32_t bad = 0;
  share_out(block, s.contacts, [&](Index p) {
    const Index c = env.contact_order[p];
    const Offset place = 3 * static_cast<Offset>(c);
    const Vector3<Real> arm_a = load3<Real>(env.arm_a + place);
    const Vector3<Real> arm_b = load3<Real>(env.arm_b + place);
    const ContactFrame<Real> frame = frame_of(load3<Real>(env.normal + place));
    for (Index k = 0; k < 3; ++k) {
      s.field.at(kFieldArmA + k, p) = env.arm_a[place + k];
      s.field.at(kFieldArmB + k, p) = env.arm_b[place + k];
      s.field.at(kFieldNormal + k, p) = env.normal[place + k];
    }
    s.field.at(kFieldMu, p) = env.mu[c];
    s.depth.at(0, p) = env.depth[c];
    ContactBlock<Real> k{Real(0), Real(0), Real(0), Real(0), Real(0), Real(0)};
    add_body(k, s.inverse_mass(slot_of(env.sides[2 * static_cast<Offset>(p)])), arm_a, frame);
    add_body(k, s.inverse_mass(slot_of(env.sides[2 * static_cast<Offset>(p) + 1])), arm_b, frame);
    if (!load_block(s, p, k, env.mu[c])) bad |= kFlagBadDiagonal;
    load_impulse(env, s, params, p, c, env.mu[c], warm);
  });
  return flags | block.combine(bad);
}

/// Sets out from the twists and depths a sub-step begins with: biases, and max|b| [w], which is returned.
template <Block B, class Real, Law kLaw, int kStride>
STICTION_HD_OUTLINE double begin_substep(B& block, const BodyEnv<Real>& env, const BodySystem<Real, kLaw, kStride>& s,
                                         const SiParams& params) {
  double largest = 0.0;
  share_out(block, s.contacts, [&](Index p) {
    const ExactContact contact = exact_contact(env, p);
    const double bias = bias_of(env, s, params, p, contact);
    const Vector3<double> u = relative_velocity(free_twist(env, s, params, slot_of(contact.side_a)), contact.arm_a,
                                                free_twist(env, s, params, slot_of(contact.side_b)), contact.arm_b);
    s.field.at(kFieldBias, p) = static_cast<Real>(bias);
    largest = max_(abs_(dot(u, contact.frame.n) + bias), largest);
    largest = max_(abs_(dot(u, contact.frame.t1)), largest);
    largest = max_(abs_(dot(u, contact.frame.t2)), largest);
  });
  largest = block.max(largest);
  // With b = 0 the answer is zero, and no warm start is better.
  if (!(largest > 0.0))
    share_out(block, s.contacts, [&](Index p) {
      for (Index k = 0; k < 3; ++k) s.x.at(k, p) = Real(0);
    });
  return largest;
}

}  // namespace stiction::inline STICTION_ISA
