#pragma once

#include "core/algorithm/residual/residual_estimate.hpp"
#include "core/algorithm/rigid/time_stepping.hpp"

/// Gauss-Seidel on velocities (docs/math/si.md). A contact reads the twists of its two bodies, takes the step every
/// solver takes, and pushes the change into those twists.
namespace stiction::inline STICTION_ISA {

/// The cone at position p of a system, as local_step() reads one: three rows at row 0.
template <class System>
struct LocalProblem {
  using Real = typename System::Real;
  /// Rows of x, or one number of the contact.
  struct Numbers {
    const typename System::Tiles& tiles;
    Index first, p;
    STICTION_HD Real operator[](Index k) const { return tiles.at(first + k, p); }
  };
  const System& s;
  Index p;
  Numbers x{s.x, 0, p};
  Numbers inv_n{s.field, kFieldInverse, p};
  Numbers inv_t{s.field, kFieldInverse + 1, p};
  Numbers damping{s.field, kFieldBlock, p};
  Numbers share{s.field, kFieldBlock + 1, p};
  [[nodiscard]] STICTION_HD Real block_entry(Index, Index i, Index j) const {
    if constexpr (System::kLaw == Law::coulomb) return s.field.at(kFieldBlock + i - 1, p);
    const Index row = i < j ? i : j;
    return s.field.at(kFieldBlock + 2 + row * (5 - row) / 2 + (i < j ? j : i), p);
  }
};

/// Under Coulomb's law only the normal's column of a contact's block is kept, so that both axes step alike.
template <int M, class System>
  requires(System::kLaw == Law::coulomb)
STICTION_HD auto is_uneven(const LocalProblem<System>&, Index) {
  using Real = typename System::Real;
  return Real(0) > Real(1);
}

using ContactShape = ConeShape<ConeKind::friction, 3>;

/// A contact's `lo`, as a residual takes that of a cone: -1 for boxed friction.
template <class Real, Law kLaw>
inline constexpr Real kLowerBound = Real(kLaw == kBoxFriction ? -1 : 0);

/// A contact while it is visited: its sides, its geometry, and the twists that its bodies had when the visit began.
/// This is one of a single system, and keeps all it has read; those of a pack have the same functions (pack_sweep.hpp).
template <class Real>
struct ContactVisit {
  Index a, b;
  Vector3<Real> arms[2];
  ContactFrame<Real> axes;
  Real friction;
  Twist<Real> twists[2];
  [[nodiscard]] STICTION_HD Index side_a() const { return a; }
  [[nodiscard]] STICTION_HD Index side_b() const { return b; }
  [[nodiscard]] STICTION_HD const Vector3<Real>& arm_a() const { return arms[0]; }
  [[nodiscard]] STICTION_HD const Vector3<Real>& arm_b() const { return arms[1]; }
  [[nodiscard]] STICTION_HD const ContactFrame<Real>& frame() const { return axes; }
  [[nodiscard]] STICTION_HD Real mu() const { return friction; }
  [[nodiscard]] STICTION_HD const Twist<Real>& twist_a() const { return twists[0]; }
  [[nodiscard]] STICTION_HD const Twist<Real>& twist_b() const { return twists[1]; }
};

/// `env` knows the sides, `s` everything else but the twists: twist_at_slot() has those.
template <class Real, Law kLaw, int kStride, class F>
STICTION_HD ContactVisit<Real> visit_with(const BodyEnv<Real>& env, const BodySystem<Real, kLaw, kStride>& s, Index p,
                                          F&& twist_at_slot) {
  const Index a = env.side(2 * static_cast<Offset>(p));
  const Index b = env.side(2 * static_cast<Offset>(p) + 1);
  return {a,
          b,
          {s.vector(kFieldArmA, p), s.vector(kFieldArmB, p)},
          s.frame(p),
          s.field.at(kFieldMu, p),
          {twist_at_slot(slot_of(a)), twist_at_slot(slot_of(b))}};
}
template <class Real, Law kLaw, int kStride>
STICTION_HD ContactVisit<Real> visit_of(const BodyEnv<Real>& env, const BodySystem<Real, kLaw, kStride>& s, Index p) {
  return visit_with(env, s, p, [&](Index slot) { return s.twist(s.motion, slot); });
}

/// Relative velocity of the two bodies at the contact.
template <class Visit>
STICTION_HD auto velocity_at(const Visit& visit) {
  return relative_velocity(visit.twist_a(), visit.arm_a(), visit.twist_b(), visit.arm_b());
}

/// Motion of a contact's rows in the solver's coordinates, y = mu (J v + bias + R lambda).
template <class System, class Visit, class Array, class Real>
STICTION_HD void motion_of(const System& s, const Visit& visit, Real bias, const Array& x, Real (&y)[3]) {
  const Vector3<Real> u = velocity_at(visit);
  const ContactFrame<Real>& frame = visit.frame();
  const Real mu = visit.mu();
  y[0] = fma_(s.compliance, x[0], dot(u, frame.n) + bias);
  y[1] = mu * fma_(s.compliance, mu * x[1], dot(u, frame.t1));
  y[2] = mu * fma_(s.compliance, mu * x[2], dot(u, frame.t2));
}

template <class Visit, class Real>
STICTION_HD Vector3<Real> impulse_of(const Visit& visit, const Real (&x)[3]) {
  return to_world(visit.frame(), x[0], visit.mu() * x[1], visit.mu() * x[2]);
}

template <class Real>
STICTION_HD Vector3<Real> opposite(const Vector3<Real>& impulse) {
  return {-impulse.x, -impulse.y, -impulse.z};
}

/// Adds an impulse to the twist of the body on one side, in the lanes that move.
template <class System, class Real, class Side>
STICTION_HD void push(const System& s, const Side& side, const Vector3<Real>& arm, const Twist<Real>& twist,
                      const Vector3<Real>& impulse, Mask<Real> moves) {
  const Mask<Real> where = and_(moves, is_pushed(side));
  if (any(where))
    s.move_side(side, where, twist, pushed(twist, s.inverse_mass(slot_of(side)), impulse, cross(arm, impulse)));
}

/// The step of a contact with boxed friction, row by row (docs/math/box_friction.md, (4)), by load_block()'s numbers.
template <class System, class Real>
STICTION_HD ConeStep<Real, 3> boxed_contact_step(const System& s, Index p, const Real (&y)[3], Real omega) {
  const Real x_n = s.x.at(0, p);
  const Real fresh = project_half_line(fma_(Real(0) - omega * s.field.at(kFieldInverse, p), y[0], x_n));
  const auto clamped = [&](Index k, Real gain, Real motion) {
    const Real x = s.x.at(k, p);
    return clamp_(fma_(Real(0) - omega * gain, motion, x), Real(0) - fresh, fresh) - x;
  };
  ConeStep<Real, 3> step;
  step.d[0] = fresh - x_n;
  step.d[1] = clamped(1, s.field.at(kFieldInverse + 1, p), fma_(s.field.at(kFieldBlock, p), step.d[0], y[1]));
  const Real pushed_by_n = fma_(s.field.at(kFieldBlock + 1, p), step.d[0], y[2]);
  step.d[2] = clamped(2, s.field.at(kFieldBlock + 3, p), fma_(s.field.at(kFieldBlock + 2, p), step.d[1], pushed_by_n));
  return step;
}

/// The step of a contact.
template <class System, class Visit>
STICTION_HD auto step_of(const System& s, const Visit& visit, Index p, typename System::Real omega) {
  const LocalProblem<System> local{s, p};
  typename System::Real y[3];
  motion_of(s, visit, s.field.at(kFieldBias, p), local.x, y);
  if constexpr (System::kLaw == kBoxFriction) {
    return boxed_contact_step(s, p, y, omega);
  } else {
    return local_step<System::kLaw>(ContactShape{}, local, 0, 0, y, omega);
  }
}

/// Takes it: moves x, and pushes the change into the twists of both bodies. Returns its size in units of w.
template <class System, class Visit, class Real>
STICTION_HD Real take_step(const System& s, const Visit& visit, Index p, const ConeStep<Real, 3>& step) {
  const Real size = step_size(step, s.field.at(kFieldWeight, p));
  const Mask<Real> moves = size != Real(0);
  if (any(moves)) {
    const Vector3<Real> impulse = impulse_of(visit, step.d);
    for (int k = 0; k < 3; ++k) s.x.at(k, p) = select(moves, s.x.at(k, p) + step.d[k], s.x.at(k, p));
    push(s, visit.side_b(), visit.arm_b(), visit.twist_b(), impulse, moves);
    push(s, visit.side_a(), visit.arm_a(), visit.twist_a(), opposite(impulse), moves);
  }
  return size;
}

/// Visits a contact: its step, then the push. Returns the step's size in units of w.
template <class Env, class System>
STICTION_HD auto visit_contact(const Env& env, const System& s, Index p, typename System::Real omega) {
  const auto visit = visit_of(env, s, p);
  return take_step(s, visit, p, step_of(s, visit, p, omega));
}

/// Contacts of vertices [first, end), one after the other. In blocks those of a vertex are visited several times before
/// the next vertex. Twists are their motion, so each visit sees the impulses of the others. One loop keeps a lane in
/// step with its neighbours, whatever their vertices are. Returns the largest step [w].
template <class Env, class System>
STICTION_HD auto visit_vertices(const Env& env, const System& s, Index first, Index end, typename System::Real omega) {
  typename System::Real largest(0);
  const Index last = env.vertex_offsets[end];
  const bool in_blocks = env.block_visits > 1;
  Index vertex = first, visit = 1, begin = env.vertex_offsets[first];
  Index stop = in_blocks && first < end ? env.vertex_offsets[first + 1] : last;
  for (Index p = begin; p < last;) {
    largest = max_(visit_contact(env, s, p, omega), largest);
    if (++p < stop || !in_blocks) continue;
    if (visit < env.block_visits && stop - begin > 1) {
      ++visit;
      p = begin;
    } else {
      visit = 1;
      begin = stop;
      if (begin < last) stop = env.vertex_offsets[++vertex + 1];
    }
  }
  return largest;
}

/// Makes one sweep, colour by colour. The vertices of a colour push no body in common and are visited at once.
/// Positions are in that order. Returns the largest step of this lane.
template <Team TeamT, class Env, class System>
STICTION_HD auto sweep_bodies(TeamT& team, const Env& env, const System& s, typename System::Real omega) {
  using Real = typename System::Real;
  Real largest(0);
  if constexpr (kInterleaved<Real, System::kStride>) {
    // One lane visits colour after colour.
    largest = visit_vertices(env, s, 0, env.color_offsets[env.color_count], omega);
  } else {
    for (Index color = 0; color < env.color_count; ++color) {
      const Index first = env.color_offsets[color];
      for_each_tiled(team, env.color_offsets[color + 1] - first, [&](Index k) {
        largest = max_(visit_vertices(env, s, first + k, first + k + 1, omega), largest);
      });
    }
  }
  return largest;
}

/// base + M^-1 J' lambda for one body that is pushed, its contacts in order of position. `impulse_at(p, of_b, arm)`
/// gives the impulse on b, and the arm of b or of a.
template <class T, class Real, class F>
STICTION_HD Twist<T> gather_impulses(const BodyEnv<Real>& env, Index body, const Twist<T>& base,
                                     const InverseMass<T>& inverse, F&& impulse_at) {
  Vector3<T> sum{T(0), T(0), T(0)};
  Vector3<T> about_center{T(0), T(0), T(0)};
  for (Index k = env.body_offsets[body]; k < env.body_offsets[body + 1]; ++k) {
    const Index entry = env.body_contacts[k];
    const bool is_b = entry >= 0;
    Vector3<T> arm;
    Vector3<T> impulse = impulse_at(is_b ? entry : ~entry, is_b, arm);
    if (!is_b) impulse = opposite(impulse);
    sum = add_scaled(sum, T(1), impulse);
    about_center = add_cross(about_center, arm, impulse);
  }
  return pushed(base, inverse, sum, about_center);
}

/// Recomputes twists from the impulses, so that rounding does not pile up in them. Momentum's earlier twists get the
/// same correction (docs/math/npgs.md, "Refreshing motion together with its history").
template <Team TeamT, class Real, Law kLaw, int kStride>
STICTION_HD_OUTLINE void refresh_bodies(TeamT& team, const BodyEnv<Real>& env, const BodySystem<Real, kLaw, kStride>& s,
                                        const SiParams& params) {
  for_each(team, s.bodies, [&](Index body) {
    const Twist<double> free = free_twist(env, s, params, body);
    const Twist<Real> base{
        {static_cast<Real>(free.linear.x), static_cast<Real>(free.linear.y), static_cast<Real>(free.linear.z)},
        {static_cast<Real>(free.angular.x), static_cast<Real>(free.angular.y), static_cast<Real>(free.angular.z)}};
    const Twist<Real> fresh =
        gather_impulses(env, body, base, s.inverse_mass(body), [&](Index p, bool is_b, Vector3<Real>& arm) {
          // Not by visit_of(): it reads twists, which other lanes write meanwhile.
          arm = s.vector(is_b ? kFieldArmB : kFieldArmA, p);
          const Real mu = s.field.at(kFieldMu, p);
          return to_world(s.frame(p), s.x.at(0, p), mu * s.x.at(1, p), mu * s.x.at(2, p));
        });
    if (s.has_momentum()) {
      const Twist<Real> stale = s.twist(s.motion, body);
      const Twist<Real> before = s.twist(s.motion_before, body);
      s.set_twist(s.motion_before, body,
                  {add_scaled(before.linear, Real(1), subtract(fresh.linear, stale.linear)),
                   add_scaled(before.angular, Real(1), subtract(fresh.angular, stale.angular))});
    }
    s.set_twist(s.motion, body, fresh);
  });
}

/// Unit of a contact's error, from its weights of reactions.
template <class T>
STICTION_HD ConeMetric<T, 3> contact_metric(T a, T press_1, T press_2) {
  const auto inverse = [](T press) {
    return select(press > T(0), div_(T(1), select(press > T(0), press, T(1))), T(0));
  };
  return {a, {T(1), press_1, press_2}, {T(1), inverse(press_1), inverse(press_2)}};
}

/// The largest error of a contact in shares of the largest error scale [w], for fresh twists.
template <Team TeamT, class Env, class System>
STICTION_HD_OUTLINE auto estimate_residual(TeamT& team, const Env& env, const System& s) {
  using Real = typename System::Real;
  Real largest(0);
  for_each_tiled(team, s.contacts, [&](Index p) {
    const auto visit = visit_of(env, s, p);
    const Real x[3] = {s.x.at(0, p), s.x.at(1, p), s.x.at(2, p)};
    Real y[3];
    motion_of(s, visit, s.field.at(kFieldBias, p), x, y);
    const Real lo(kLowerBound<Scalar<Real>, System::kLaw>);
    const auto metric =
        contact_metric(s.field.at(kFieldPress, p), s.field.at(kFieldPress + 1, p), s.field.at(kFieldPress + 2, p));
    const Real share = s.field.at(kFieldShare, p);
    const Real square = law_error_square<System::kLaw>(ContactShape{}, x, y, metric, lo, Real(0));
    // No sweep moves a held contact, whose share is negative.
    largest = max_(select(share > Real(0), (square * share) * share, Real(0)), largest);
  });
  return sqrt_(team.max(largest));
}

}  // namespace stiction::inline STICTION_ISA
