#pragma once

#include "core/algorithm/load/load_system.hpp"
#include "core/algorithm/residual/final_residual.hpp"
#include "core/algorithm/rigid/si_sweep.hpp"

/// From the batch's arrays to a system that can be swept.
namespace stiction::inline STICTION_ISA {

/// Whether all numbers that were added are finite. Zero times anything else is no number, and stays that way; there is
/// no branch on any of them.
template <class Real>
class FiniteProbe {
 public:
  STICTION_HD void add(Real value) { trace_ = fma_(value, Real(0), trace_); }
  STICTION_HD void add(const Real* values, Index count) {
    for (Index k = 0; k < count; ++k) add(values[k]);
  }
  [[nodiscard]] STICTION_HD bool is_finite() const { return trace_ == Real(0); }

 private:
  Real trace_ = Real(0);
};

/// EnvFlag bits of an environment's own numbers, before anything is projected: a projection would hide a NaN.
template <Team TeamT, class Real>
STICTION_HD_OUTLINE std::uint32_t inspect_bodies(TeamT& team, const BodyEnv<Real>& env) {
  std::uint32_t flags = env.kept < env.contacts ? kFlagContactsDropped : 0U;
  for (Index body = team.rank(); body < env.bodies; body += team.size()) {
    const Offset row = 6 * static_cast<Offset>(body);
    FiniteProbe<Real> probe;
    probe.add(env.twist + row, 6);
    if (!env.is_kinematic(body)) {
      probe.add(env.inv_mass[body]);
      probe.add(env.inv_inertia + row, 6);
      if (env.twist_change != nullptr) probe.add(env.twist_change + row, 6);
      if (env.inv_mass[body] < Real(0)) flags |= kFlagBadMass;
    }
    if (!probe.is_finite()) flags |= kFlagNonFiniteInput;
  }
  for (Index c = team.rank(); c < env.contacts; c += team.size()) {
    const Offset row = 3 * static_cast<Offset>(c);
    FiniteProbe<Real> probe;
    probe.add(env.arm_a + row, 3);
    probe.add(env.arm_b + row, 3);
    probe.add(env.normal + row, 3);
    probe.add(env.mu[c]);
    probe.add(env.depth[c]);
    probe.add(env.restitution[c]);
    if (!probe.is_finite()) flags |= kFlagNonFiniteInput;
    if (env.mu[c] < Real(0)) flags |= kFlagNegativeFriction;
    if (env.warm_start == nullptr) continue;
    FiniteProbe<Real> guess;
    guess.add(env.warm_start + row, 3);
    if (!guess.is_finite()) flags |= kFlagWarmStartRejected;
  }
  return team.combine(flags);
}

/// Whether a body environment with those flags can be solved.
STICTION_HD bool can_sweep(std::uint32_t flags) {
  return (flags & ~static_cast<std::uint32_t>(kFlagWarmStartRejected | kFlagContactsDropped)) == 0;
}

template <Team TeamT, class Real, Law kLaw, int kStride>
STICTION_HD void load_masses(TeamT& team, const BodyEnv<Real>& env, const BodySystem<Real, kLaw, kStride>& s) {
  for_each(team, s.bodies + 1, [&](Index body) {
    const bool world = body == s.bodies;
    const bool pushed = !world && !env.is_kinematic(body);
    const auto mass = s.mass_row(body);
    const auto start = s.twist_row(s.start, body);
    const auto motion = s.twist_row(s.motion, body);
    mass[0] = pushed ? env.inv_mass[body] : Real(0);
    for (Index k = 0; k < 6; ++k) {
      const Offset slot = 6 * static_cast<Offset>(body) + k;
      mass[1 + k] = pushed ? env.inv_inertia[slot] : Real(0);
      start[k] = motion[k] = world ? Real(0) : env.twist[slot];
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

/// 1 / diagonal of a tangential row of boxed friction, at most 2^60 of `inv_t`. A row that couples to nothing still
/// needs a finite step, as in box_friction_step().
template <class Real>
STICTION_HD Real axis_gain(Real diagonal, Real inv_t) {
  const Real far = inv_t * Real(0x1p60F);
  const Real most = select(finite_(far), far, inv_t);
  const Real inverse = div_(Real(1), diagonal);
  return select(and_(diagonal > Real(0), inverse < most), inverse, most);
}

/// The constants of a contact's local problem, and whether it can be solved. One that is held can be: neither body
/// yields along its normal, so it carries nothing (docs/math/immovable.md).
template <class Real, Law kLaw, int kStride>
STICTION_HD Mask<Real> load_block(const BodySystem<Real, kLaw, kStride>& s, Index p, const ContactBlock<Real>& block) {
  const Real r = s.compliance;
  const Real mu = s.field.at(kFieldMu, p);
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
  } else if constexpr (kLaw == kBoxFriction) {
    s.field.at(kFieldInverse + 1, p) = axis_gain(one.block[1][1], inv_t);
    s.field.at(kFieldBlock, p) = one.block[1][0];
    s.field.at(kFieldBlock + 1, p) = one.block[2][0];
    s.field.at(kFieldBlock + 2, p) = one.block[2][1];
    s.field.at(kFieldBlock + 3, p) = axis_gain(one.block[2][2], inv_t);
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
  const auto held = and_(normal == Real(0), and_(block.n1 == Real(0), block.n2 == Real(0)));
  return and_(or_(normal > Real(0), held), and_(block.t11 + r >= Real(0), block.t22 + r >= Real(0)));
}

/// Whether a loaded contact is held.
template <class System>
STICTION_HD auto is_held(const System& s, Index p) {
  return s.field.at(kFieldInverse, p) == typename System::Real(0);
}
/// Its bias, which no motion outweighs: to an iteration it is a contact that opens.
inline constexpr float kHeldBias = 0x1p60F;

/// In the lanes of `warm` x is a contact's warm start: it becomes the share of one sub-step, on its cone.
template <class Real, Law kLaw, int kStride>
STICTION_HD void start_impulse(const BodySystem<Real, kLaw, kStride>& s, const SiParams& params, Index p,
                               Mask<Real> warm) {
  const Real share(static_cast<Scalar<Real>>(div_(1.0, static_cast<double>(params.substeps))));
  const Real mu = s.field.at(kFieldMu, p);
  Real z[3];
  z[0] = s.x.at(0, p) * share;
  for (int k = 1; k < 3; ++k) z[k] = unit_reaction(s.x.at(k, p) * share, mu);
  if constexpr (kLaw == kBoxFriction) {
    z[0] = project_half_line(z[0]);
    project_box<3>(z, z[0]);
  } else {
    project_second_order_cone<3>(z);
  }
  const auto held = is_held(s, p);
  for (int k = 0; k < 3; ++k) s.x.at(k, p) = select(warm, select(held, Real(0), canonical_zero(z[k])), s.x.at(k, p));
}

/// The numbers of the contact at position p as the batch has them; x is its warm start, or zero.
template <class Real, Law kLaw, int kStride>
STICTION_HD void take_contact(const BodyEnv<Real>& env, const BodySystem<Real, kLaw, kStride>& s, Index p, bool warm) {
  const Index c = env.contact_order[p];
  const Offset slot = 3 * static_cast<Offset>(c);
  for (Index k = 0; k < 3; ++k) {
    s.field.at(kFieldArmA + k, p) = env.arm_a[slot + k];
    s.field.at(kFieldArmB + k, p) = env.arm_b[slot + k];
    s.field.at(kFieldNormal + k, p) = env.normal[slot + k];
    s.x.at(k, p) = warm ? env.warm_start[slot + k] : Real(0);
  }
  s.field.at(kFieldMu, p) = env.mu[c];
  s.depth.at(0, p) = env.depth[c];
}

/// What is computed of them and of the bodies' masses. Whether the contact can be solved.
template <class System, class Slot>
STICTION_HD auto load_contact(const System& s, Index p, const ContactFrame<typename System::Real>& frame,
                              const Slot& slot_a, const Slot& slot_b) {
  using Real = typename System::Real;
  ContactBlock<Real> block{Real(0), Real(0), Real(0), Real(0), Real(0), Real(0)};
  add_body(block, s.inverse_mass(slot_a), s.vector(kFieldArmA, p), frame);
  add_body(block, s.inverse_mass(slot_b), s.vector(kFieldArmB, p), frame);
  return load_block(s, p, block);
}

/// Whether an environment with those flags has a warm start that is taken.
template <class Real>
STICTION_HD bool is_warm(const BodyEnv<Real>& env, std::uint32_t flags) {
  return env.warm_start != nullptr && (flags & kFlagWarmStartRejected) == 0;
}

/// Fills a system with everything but what a sub-step changes. Returns flags.
template <Team TeamT, class Real, Law kLaw, int kStride>
STICTION_HD_OUTLINE std::uint32_t load_bodies(TeamT& team, const BodyEnv<Real>& env,
                                              const BodySystem<Real, kLaw, kStride>& s, const SiParams& params,
                                              bool warm) {
  load_masses(team, env, s);
  std::uint32_t bad = 0;
  for_each_tiled(team, s.contacts, [&](Index p) {
    take_contact(env, s, p, warm);
    const Offset side = 2 * static_cast<Offset>(p);
    if (!load_contact(s, p, s.frame(p), slot_of(env.sides[side]), slot_of(env.sides[side + 1])))
      bad |= kFlagBadDiagonal;
    if (warm) start_impulse(s, params, p, true);
  });
  return team.combine(bad);
}

/// With b = 0 the answer is zero, and no warm start is better.
template <Team TeamT, class Real, Law kLaw, int kStride>
STICTION_HD void rest(TeamT& team, const BodySystem<Real, kLaw, kStride>& s) {
  for_each_tiled(team, s.contacts, [&](Index p) {
    for (Index k = 0; k < 3; ++k) s.x.at(k, p) = Real(0);
  });
}

/// Sets out from the twists and depths a sub-step begins with: biases, and max|b| [w], which is returned.
template <Team TeamT, class Real, Law kLaw, int kStride>
STICTION_HD_OUTLINE double begin_substep(TeamT& team, const BodyEnv<Real>& env,
                                         const BodySystem<Real, kLaw, kStride>& s, const SiParams& params) {
  double largest = 0.0;
  for_each_tiled(team, s.contacts, [&](Index p) {
    const ExactContact contact = exact_contact(env, p);
    const double bias = bias_of(env, s, params, p, contact);
    s.field.at(kFieldBias, p) = is_held(s, p) ? Real(kHeldBias) : static_cast<Real>(bias);
    largest = largest_free_motion<double>(contact, free_twist(env, s, params, slot_of(contact.side_a)),
                                          free_twist(env, s, params, slot_of(contact.side_b)), bias, largest);
  });
  largest = team.max(largest);
  if (!(largest > 0.0)) rest(team, s);
  return largest;
}

}  // namespace stiction::inline STICTION_ISA
