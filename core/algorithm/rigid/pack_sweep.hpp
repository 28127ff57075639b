#pragma once

#include "core/algorithm/rigid/body_pack.hpp"
#include "core/algorithm/system/system_pair.hpp"

/// Sequential impulses in the lanes of a pack, or of two that take turns. Host only.
namespace stiction::inline STICTION_ISA {

/// Contact p of all lanes. A core has too few registers to keep a visit's numbers: each is read where it is needed.
template <class T, int W, Law kLaw>
struct PackGeometry {
  using Real = Pack<T, W>;
  const BodyPack<T, W, kLaw>& s;
  Index p;
  [[nodiscard]] STICTION_HD Vector3<Real> arm_a() const { return s.vector(kFieldArmA, p); }
  [[nodiscard]] STICTION_HD Vector3<Real> arm_b() const { return s.vector(kFieldArmB, p); }
  [[nodiscard]] STICTION_HD ContactFrame<Real> frame() const { return s.frame(p); }
  [[nodiscard]] STICTION_HD Real mu() const { return s.field.at(kFieldMu, p); }
};
template <class T, int W, Law kLaw>
struct UniformVisit : PackGeometry<T, W, kLaw> {
  using Real = Pack<T, W>;
  UniformSide<T, W> a, b;
  [[nodiscard]] STICTION_HD const UniformSide<T, W>& side_a() const { return a; }
  [[nodiscard]] STICTION_HD const UniformSide<T, W>& side_b() const { return b; }
  [[nodiscard]] STICTION_HD Twist<Real> twist_a() const { return this->s.twist(this->s.motion, a.slot); }
  [[nodiscard]] STICTION_HD Twist<Real> twist_b() const { return this->s.twist(this->s.motion, b.slot); }
};
/// Twists are gathered once if lanes have different bodies.
template <class T, int W, Law kLaw>
struct LaneVisit : PackGeometry<T, W, kLaw> {
  using Real = Pack<T, W>;
  LaneSides<T, W> a, b;
  Twist<Real> of_a, of_b;
  [[nodiscard]] STICTION_HD const LaneSides<T, W>& side_a() const { return a; }
  [[nodiscard]] STICTION_HD const LaneSides<T, W>& side_b() const { return b; }
  [[nodiscard]] STICTION_HD const Twist<Real>& twist_a() const { return of_a; }
  [[nodiscard]] STICTION_HD const Twist<Real>& twist_b() const { return of_b; }
};
template <class T, int W, Law kLaw>
STICTION_HD UniformVisit<T, W, kLaw> visit_of(const UniformEnv<T, W>& env, const BodyPack<T, W, kLaw>& s, Index p) {
  const Offset side_index = 2 * static_cast<Offset>(p);
  return {{s, p}, env.side(side_index), env.side(side_index + 1)};
}
template <class T, int W, Law kLaw>
STICTION_HD LaneVisit<T, W, kLaw> visit_of(const PackEnv<T, W>& env, const BodyPack<T, W, kLaw>& s, Index p) {
  const LaneSides<T, W> a = env.side(2 * static_cast<Offset>(p));
  const LaneSides<T, W> b = env.side(2 * static_cast<Offset>(p) + 1);
  return {{s, p}, a, b, s.twist(s.motion, slot_of(a)), s.twist(s.motion, slot_of(b))};
}

/// Contacts [first, end), one after the other. Returns the largest step [w].
template <class Env, class System>
STICTION_HD auto visit_run(const Env& env, const System& s, Index first, Index end, typename System::Real omega) {
  typename System::Real largest(0);
  for (Index p = first; p < end; ++p) largest = max_(visit_contact(env, s, p, omega), largest);
  return largest;
}

/// A sweep of a pack from contact `first` on. Returns the largest step of each lane [w].
template <class T, int W, Law kLaw>
STICTION_HD Pack<T, W> sweep_from(const PackEnv<T, W>& env, const BodyPack<T, W, kLaw>& s, Index first,
                                  Pack<T, W> omega) {
  Pack<T, W> largest(0);
  const auto is_uniform_at = [&](Index k) { return is_uniform(env, first + k); };
  for_each_run(s.contacts - first, is_uniform_at, [&](bool uniform, Index begin, Index end) {
    const Pack<T, W> size = uniform ? visit_run(UniformEnv<T, W>{env.sides}, s, first + begin, first + end, omega)
                                    : visit_run(env, s, first + begin, first + end, omega);
    largest = max_(size, largest);
  });
  return largest;
}
/// A sweep of a pack in blocks. Each lane works as visit_vertices(): contacts of a block are visited again once its
/// last one was. Returns the largest step of each lane [w].
template <class T, int W, Law kLaw>
STICTION_HD Pack<T, W> sweep_blocks(const PackEnv<T, W>& env, const BodyPack<T, W, kLaw>& s, Pack<T, W> omega) {
  Pack<T, W> largest(0);
  const auto with_sides = [&](Index p, auto&& f) { is_uniform(env, p) ? f(UniformEnv<T, W>{env.sides}) : f(env); };
  const auto visit_again = [&](const auto& sides, Index last, Index p) {
    const auto visit = visit_of(sides, s, p);
    auto step = step_of(s, visit, p, omega);
    for (auto& d : step.d) d = select(env.blocks.has(last, p), d, Pack<T, W>(0));
    largest = max_(take_step(s, visit, p, step), largest);
  };
  for (Index last = 0; last < s.contacts; ++last) {
    with_sides(last, [&](const auto& sides) { largest = max_(visit_contact(sides, s, last, omega), largest); });
    for (Index visit = 1; visit < kBlockVisits; ++visit)
      for (Index p = last + 1 - env.blocks.longest[last]; p <= last; ++p)
        with_sides(p, [&](const auto& sides) { visit_again(sides, last, p); });
  }
  return largest;
}
template <Team TeamT, class T, int W, Law kLaw>
STICTION_HD Pack<T, W> sweep_bodies(TeamT&, const PackEnv<T, W>& env, const BodyPack<T, W, kLaw>& s, Pack<T, W> omega) {
  return env.blocks.ends != nullptr ? sweep_blocks(env, s, omega) : sweep_from(env, s, 0, omega);
}

/// The sides of two packs.
template <class Env>
struct EnvPair {
  const Env& a;
  const Env& b;
};

/// visit_run() of two packs that alternate: the work of one hides the latency of the other.
template <class Env, class System, class Real>
STICTION_HD void visit_run(const EnvPair<Env>& env, const SystemPair<System>& s, Index first, Index end, Real omega,
                           NumberPair<Real>& largest) {
  for (Index p = first; p < end; ++p) {
    const auto visit_a = visit_of(env.a, s.a, p);
    const auto visit_b = visit_of(env.b, s.b, p);
    const auto step_a = step_of(s.a, visit_a, p, omega);
    const auto step_b = step_of(s.b, visit_b, p, omega);
    largest.a = max_(take_step(s.a, visit_a, p, step_a), largest.a);
    largest.b = max_(take_step(s.b, visit_b, p, step_b), largest.b);
  }
}

/// One sweep of two packs that alternate. In blocks they do not: one follows the other.
template <Team TeamT, class T, int W, Law kLaw>
STICTION_HD NumberPair<Pack<T, W>> sweep_bodies(TeamT& team, const EnvPair<PackEnv<T, W>>& env,
                                                const SystemPair<const BodyPack<T, W, kLaw>>& s, Pack<T, W> omega) {
  if (env.a.blocks.ends != nullptr)
    return {sweep_bodies(team, env.a, s.a, omega), sweep_bodies(team, env.b, s.b, omega)};
  using Uniform = UniformEnv<T, W>;
  NumberPair<Pack<T, W>> largest{Pack<T, W>(0), Pack<T, W>(0)};
  const Index common = s.a.contacts < s.b.contacts ? s.a.contacts : s.b.contacts;
  const auto is_uniform_at = [&](Index p) { return is_uniform(env.a, p) && is_uniform(env.b, p); };
  for_each_run(common, is_uniform_at, [&](bool uniform, Index first, Index end) {
    if (uniform) {
      visit_run(EnvPair<Uniform>{Uniform{env.a.sides}, Uniform{env.b.sides}}, s, first, end, omega, largest);
    } else {
      visit_run(env, s, first, end, omega, largest);
    }
  });
  largest.a = max_(sweep_from(env.a, s.a, common, omega), largest.a);
  largest.b = max_(sweep_from(env.b, s.b, common, omega), largest.b);
  return largest;
}

/// A sweep of two packs with momentum.
template <Team TeamT, class Env, class System, class Real>
STICTION_HD void accelerated_sweep(TeamT& team, const EnvPair<Env>& env, const SystemPair<System>& s, Real omega,
                                   NumberPair<SiMomentum<Real>>& momentum) {
  const NesterovStep<Real> lead_a = nesterov_step(momentum.a.theta);
  const NesterovStep<Real> lead_b = nesterov_step(momentum.b.theta);
  extrapolate(team, s.a, lead_a.beta);
  extrapolate(team, s.b, lead_b.beta);
  const NumberPair<Real> progress = sweep_bodies(team, env, s, omega);
  follow(momentum.a, lead_a, progress.a);
  follow(momentum.b, lead_b, progress.b);
}

/// Does refresh_bodies() in the lanes of `due`. It visits contacts in order instead of bodies one by one, which gives
/// each body's sum the same terms in the same order.
template <class T, int W, Law kLaw>
STICTION_HD void refresh_lanes(const PackEnv<T, W>& env, const BodyPack<T, W, kLaw>& s, PackMask<T, W> due) {
  using Real = Pack<T, W>;
  const Vector3<Real> zero{Real(0), Real(0), Real(0)};
  for (Index slot = 0; slot <= s.bodies; ++slot) s.set_twist(s.sums, slot, {zero, zero});
  const auto add = [&](const LaneSides<T, W>& side, const Vector3<Real>& arm, const Vector3<Real>& impulse) {
    const PackMask<T, W> where = is_pushed(side);
    if (!any(where)) return;
    const LaneSlots<T, W> at = slot_of(side);
    const Twist<Real> sum = s.twist(s.sums, at);
    s.set_twist(s.sums, at, where, sum,
                {add_scaled(sum.linear, Real(1), impulse), add_cross(sum.angular, arm, impulse)});
  };
  for (Index p = 0; p < s.contacts; ++p) {
    const PackGeometry<T, W, kLaw> contact{s, p};
    const Real x[3] = {s.x.at(0, p), s.x.at(1, p), s.x.at(2, p)};
    const Vector3<Real> impulse = impulse_of(contact, x);
    add(env.side(2 * static_cast<Offset>(p) + 1), contact.arm_b(), impulse);
    add(env.side(2 * static_cast<Offset>(p)), contact.arm_a(), opposite(impulse));
  }
  for (Index body = 0; body < s.bodies; ++body) {
    const Twist<Real> sum = s.twist(s.sums, body);
    const Twist<Real> fresh = pushed(s.twist(s.free, body), s.inverse_mass(body), sum.linear, sum.angular);
    const auto now = s.twist_row(s.motion, body);
    Real value[6];
    Real* const numbers = value;
    put_twist(numbers, fresh);
    if (s.has_momentum()) {
      const auto before = s.twist_row(s.motion_before, body);
      for (Index k = 0; k < 6; ++k) before[k] = select(due, fma_(Real(1), value[k] - now[k], before[k]), before[k]);
    }
    for (Index k = 0; k < 6; ++k) now[k] = select(due, value[k], now[k]);
  }
}

}  // namespace stiction::inline STICTION_ISA
