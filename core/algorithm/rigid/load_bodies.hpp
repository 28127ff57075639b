#pragma once

#include "core/algorithm/load/islands.hpp"
#include "core/algorithm/load/load_system.hpp"
#include "core/algorithm/residual/final_residual.hpp"
#include "core/algorithm/rigid/si_sweep.hpp"

/// From the batch's arrays to a system that can be swept.
namespace stiction::inline STICTION_ISA {

/// Returns true if all numbers that were added are finite. Zero times anything else is NaN, and stays that way; there
/// is no branch on any of them.
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
    for (Index k = 0; k < 3; ++k)
      if (!can_start_from(env.warm_start[row + k])) flags |= kFlagWarmStartRejected;
  }
  return team.combine(flags);
}

/// Returns true if a body environment with those flags can be solved.
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
  const Real a = max_(block.nn + r, Real(0));
  s.field.at(kFieldPress, p) = a;
  s.field.at(kFieldPress + 1, p) = axis_weights(a, block.t11 + r, mu).press;
  s.field.at(kFieldPress + 2, p) = axis_weights(a, block.t22 + r, mu).press;
  const auto held = and_(normal == Real(0), and_(block.n1 == Real(0), block.n2 == Real(0)));
  return and_(or_(normal > Real(0), held), and_(block.t11 + r >= Real(0), block.t22 + r >= Real(0)));
}

/// Returns true if a loaded contact is held.
template <class System>
STICTION_HD auto is_held(const System& s, Index p) {
  return s.field.at(kFieldPress, p) == typename System::Real(0);
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

/// Computes their dependents on them and the bodies' masses. Returns true if the contact can be solved.
template <class System, class Slot>
STICTION_HD auto load_contact(const System& s, Index p, const ContactFrame<typename System::Real>& frame,
                              const Slot& slot_a, const Slot& slot_b) {
  using Real = typename System::Real;
  ContactBlock<Real> block{Real(0), Real(0), Real(0), Real(0), Real(0), Real(0)};
  add_body(block, s.inverse_mass(slot_a), s.vector(kFieldArmA, p), frame);
  add_body(block, s.inverse_mass(slot_b), s.vector(kFieldArmB, p), frame);
  return load_block(s, p, block);
}

/// Returns true if an environment with those flags has a warm start that is taken.
template <class Real>
STICTION_HD bool is_warm(const BodyEnv<Real>& env, std::uint32_t flags) {
  return env.warm_start != nullptr && (flags & kFlagWarmStartRejected) == 0;
}

/// Fills a system with everything but the changes of a sub-step. Returns flags.
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

/// The error scale of a contact alone, from b. `unit`: ErrorScale's.
template <Law kLaw, class T>
STICTION_HD T error_at_rest(const T (&b)[3], T mu, const ConeMetric<T, 3>& metric, T unit) {
  const T none[3] = {T(0), T(0), T(0)};
  const T y[3] = {b[0] * unit, mu * (b[1] * unit), mu * (b[2] * unit)};
  const T largest = max_(abs_(b[2]), max_(abs_(b[1]), abs_(b[0])));
  const T lo(kLowerBound<Scalar<T>, kLaw>);
  const T square = law_error_square<kLaw>(ContactShape{}, none, y, metric, lo, T(0));
  return max_(div_(sqrt_(square), unit), T(static_cast<double>(kIdleShare)) * largest);
}

/// Returns true if forces move a body at all: one that is locked couples nothing.
template <class Real, Law kLaw, int kStride>
STICTION_HD bool is_movable(const BodySystem<Real, kLaw, kStride>& s, Index side) {
  if (!is_pushed(side)) return false;
  const auto mass = s.mass_row(side);
  for (Index k = 0; k < 7; ++k)
    if (mass[k] != Real(0)) return true;
  return false;
}

/// Spreads the error scales that contacts have over those of their islands, by one lane. reach: six numbers a body, of
/// which the first is the largest scale that is known to reach it. Returns true if any of them grew.
template <class Real, Law kLaw, int kStride>
STICTION_HD_OUTLINE bool spread_scales(const BodyEnv<Real>& env, const BodySystem<Real, kLaw, kStride>& s,
                                       const Strided<double, kStride>& reach) {
  const auto number = [&](Index body, Index k) -> double& { return reach[6 * static_cast<Offset>(body) + k]; };
  const auto parent = [&](Index body) -> double& { return number(body, 1); };
  for (Index body = 0; body < s.bodies; ++body) {
    number(body, 1) = static_cast<double>(body);
    number(body, 2) = number(body, 0);
  }
  const auto sides = [&](Index p, auto&& f) {
    for (Index k = 0; k < 2; ++k) {
      const Index side = env.sides[2 * static_cast<Offset>(p) + k];
      if (is_movable(s, side)) f(side);
    }
  };
  for (Index p = 0; p < s.contacts; ++p) {
    Index first = -1;
    sides(p, [&](Index side) {
      if (first >= 0) join_sets(parent, first, side);
      first = side;
    });
  }
  const auto raise = [&](Index body, double scale) {
    double& known = number(root_of(parent, body), 2);
    known = max_(scale, known);
  };
  for (Index body = 0; body < s.bodies; ++body) raise(body, number(body, 0));
  for (Index p = 0; p < s.contacts; ++p)
    sides(p, [&](Index side) { raise(side, static_cast<double>(s.field.at(kFieldShare, p))); });
  bool has_grown = false;
  for (Index body = 0; body < s.bodies; ++body) {
    const double found = number(root_of(parent, body), 2);
    has_grown = has_grown || found > number(body, 0);
    number(body, 0) = found;
  }
  for (Index p = 0; p < s.contacts; ++p)
    sides(p, [&](Index side) { s.field.at(kFieldShare, p) = static_cast<Real>(number(side, 0)); });
  return has_grown;
}

/// Brings scales to other memories that have parts of an environment; whether any grew there. Here there are none.
template <Team TeamT, class Real, Law kLaw, int kStride>
STICTION_HD bool share_scales(TeamT&, const BodyEnv<Real>&, const BodySystem<Real, kLaw, kStride>&,
                              const Strided<double, kStride>&, bool) {
  return false;
}

/// Turns the contacts' own error scales, which are in kFieldShare, into shares of `most`, the largest
/// (docs/math/residual.md). An impulse in an island that needs nothing is left out. Held contacts have a negative
/// share.
template <Team TeamT, class Real, Law kLaw, int kStride>
STICTION_HD_OUTLINE void weigh_islands(TeamT& team, const BodyEnv<Real>& env, const BodySystem<Real, kLaw, kStride>& s,
                                       const Strided<double, kStride>& reach, double most) {
  double differs = 0.0;
  for_each_tiled(team, s.contacts, [&](Index p) {
    if (is_held(s, p)) return;
    differs =
        static_cast<double>(s.field.at(kFieldShare, p)) != static_cast<double>(static_cast<Real>(most)) ? 1.0 : differs;
  });
  if (team.max(differs) > 0.0) {
    for_each(team, s.bodies + 1, [&](Index body) { reach[6 * static_cast<Offset>(body)] = 0.0; });
    bool goes_on = true;
    while (goes_on) {
      const bool has_grown = team.broadcast([&] { return spread_scales(env, s, reach); });
      team.sync();
      goes_on = share_scales(team, env, s, reach, has_grown);
    }
  }
  for_each_tiled(team, s.contacts, [&](Index p) {
    Real& share = s.field.at(kFieldShare, p);
    if (is_held(s, p)) {
      share = Real(0) - island_share(static_cast<Real>(most), share);
      return;
    }
    if (!(share > Real(0)))
      for (Index k = 0; k < 3; ++k) s.x.at(k, p) = Real(0);
    share = most > 0.0 ? island_share(static_cast<Real>(most), share) : Real(1);
  });
}

/// Sets out from the twists and depths a sub-step begins with: biases, and units of errors. Returns the largest
/// island's error scale [w].
template <Team TeamT, class Real, Law kLaw, int kStride>
STICTION_HD_OUTLINE ErrorScale begin_substep(TeamT& team, const BodyEnv<Real>& env,
                                             const BodySystem<Real, kLaw, kStride>& s, const SiParams& params) {
  const auto find_b = [&](Index p, double (&b)[3]) {
    const ExactContact contact = exact_contact(env, p);
    const double bias = bias_of(env, s, params, p, contact);
    free_motion<double>(contact, free_twist(env, s, params, slot_of(contact.side_a)),
                        free_twist(env, s, params, slot_of(contact.side_b)), bias, b);
    return bias;
  };
  double largest = 0.0;
  for_each_tiled(team, s.contacts, [&](Index p) {
    double b[3];
    const Real bias = static_cast<Real>(find_b(p, b));
    s.field.at(kFieldBias, p) = is_held(s, p) ? Real(kHeldBias) : bias;
    for (const double value : b) largest = max_(abs_(value), largest);
  });
  largest = team.max(largest);
  const double unit = error_unit(largest);
  double most = 0.0, of_held = 0.0;
  for_each_tiled(team, s.contacts, [&](Index p) {
    double b[3];
    find_b(p, b);
    const auto field = [&](Index k) { return static_cast<double>(s.field.at(k, p)); };
    const auto metric = contact_metric(field(kFieldPress), field(kFieldPress + 1), field(kFieldPress + 2));
    const Real own = saturated<Real>(error_at_rest<kLaw>(b, field(kFieldMu), metric, unit));
    s.field.at(kFieldShare, p) = own;
    if (is_held(s, p)) {
      of_held = max_(static_cast<double>(own), of_held);
    } else {
      most = max_(static_cast<double>(own), most);
    }
  });
  most = team.max(most);
  of_held = team.max(of_held);
  if (!(most > 0.0)) most = of_held;
  weigh_islands(team, env, s, s.exact, most > 1e-300 ? most : 0.0);
  return {max_(most, 1e-300), unit};
}

}  // namespace stiction::inline STICTION_ISA
