#pragma once

#include "core/body/bodies/time_stepping.hpp"
#include "core/body/record_body.hpp"

/// Gauss-Seidel on velocities: a contact reads the twists of its two bodies, takes the step every solver takes, and
/// pushes the change into those twists (docs/math/si.md).
namespace stiction::inline STICTION_ISA {

/// One contact as local_step() and largest_eigenvalue_bound() read a system: a cone of three rows at row 0.
template <class RealType>
struct OneContact {
  using Real = RealType;
  Real x[3] = {};
  Real inv_n[1] = {};
  Real inv_t[1] = {};
  Real damping[1] = {};
  Real share[1] = {};
  Real block[3][3] = {};
  [[nodiscard]] STICTION_HD Real block_entry(Index, Index i, Index j) const { return block[i][j]; }
};

using ContactShape = ConeShape<ConeKind::friction, 3>;

/// A contact's geometry while it is visited. A side is a number, or one for each lane of a pack.
template <class Real, class Side>
struct Visit {
  Side side_a, side_b;
  Vector3<Real> arm_a, arm_b;
  ContactFrame<Real> frame;
  Real mu;
};

/// `env` knows the sides, `s` everything else. A system is one (BodySystem) or those of a pack's lanes (BodyPack).
template <class Env, class System>
STICTION_HD auto visit_of(const Env& env, const System& s, Index p) {
  using Side = decltype(env.side(Offset{}));
  return Visit<typename System::Real, Side>{env.side(2 * static_cast<Offset>(p)),
                                            env.side(2 * static_cast<Offset>(p) + 1),
                                            s.vector(kFieldArmA, p),
                                            s.vector(kFieldArmB, p),
                                            s.frame(p),
                                            s.field.at(kFieldMu, p)};
}

/// Motion of a contact's rows in the solver's coordinates, y = mu (J v + bias + R lambda).
template <class System, class Real, class Side>
STICTION_HD void motion_of(const System& s, const Visit<Real, Side>& visit, Real bias, const Twist<Real>& a,
                           const Twist<Real>& b, const Real (&x)[3], Real (&y)[3]) {
  const Vector3<Real> u = relative_velocity(a, visit.arm_a, b, visit.arm_b);
  y[0] = fma_(s.compliance, x[0], dot(u, visit.frame.n) + bias);
  y[1] = visit.mu * fma_(s.compliance, visit.mu * x[1], dot(u, visit.frame.t1));
  y[2] = visit.mu * fma_(s.compliance, visit.mu * x[2], dot(u, visit.frame.t2));
}

template <class Real, class Side>
STICTION_HD Vector3<Real> impulse_of(const Visit<Real, Side>& visit, const Real (&x)[3]) {
  return to_world(visit.frame, x[0], visit.mu * x[1], visit.mu * x[2]);
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

template <class System>
STICTION_HD OneContact<typename System::Real> local_problem(const System& s, Index p) {
  OneContact<typename System::Real> one;
  for (int k = 0; k < 3; ++k) one.x[k] = s.x.at(k, p);
  one.inv_n[0] = s.field.at(kFieldInverse, p);
  one.inv_t[0] = s.field.at(kFieldInverse + 1, p);
  if constexpr (System::kLaw == Law::coulomb) {
    one.block[1][0] = s.field.at(kFieldBlock, p);
    one.block[2][0] = s.field.at(kFieldBlock + 1, p);
  } else {
    one.damping[0] = s.field.at(kFieldBlock, p);
    one.share[0] = s.field.at(kFieldBlock + 1, p);
    Index field = kFieldBlock + 2;
    for (int i = 0; i < 3; ++i)
      for (int j = i; j < 3; ++j) one.block[i][j] = one.block[j][i] = s.field.at(field++, p);
  }
  return one;
}

/// One contact's step. Returns its size in units of w.
template <class Env, class System>
STICTION_HD auto visit_contact(const Env& env, const System& s, Index p, typename System::Real omega) {
  using Real = typename System::Real;
  const auto visit = visit_of(env, s, p);
  const Twist<Real> a = s.twist(s.motion, slot_of(visit.side_a));
  const Twist<Real> b = s.twist(s.motion, slot_of(visit.side_b));
  const OneContact<Real> one = local_problem(s, p);
  Real y[3];
  motion_of(s, visit, s.field.at(kFieldBias, p), a, b, one.x, y);
  const ConeStep<Real, 3> step = local_step<System::kLaw>(ContactShape{}, one, 0, 0, y, omega);
  const Real size = step_size(step, s.field.at(kFieldWeight, p));
  const Mask<Real> moves = size != Real(0);
  if (any(moves)) {
    for (int k = 0; k < 3; ++k) s.x.at(k, p) = select(moves, one.x[k] + step.d[k], one.x[k]);
    const Vector3<Real> impulse = impulse_of(visit, step.d);
    push(s, visit.side_b, visit.arm_b, b, impulse, moves);
    push(s, visit.side_a, visit.arm_a, a, opposite(impulse), moves);
  }
  return size;
}

/// One sweep, colour by colour: the vertices of a colour push no body in common and are visited at once, the contacts
/// of a vertex one after the other. Positions are in that order. Returns the largest step of this lane.
template <Block B, class Env, class System>
STICTION_HD auto sweep_bodies(B& block, const Env& env, const System& s, typename System::Real omega) {
  using Real = typename System::Real;
  Real largest(0);
  if constexpr (kInterleaved<Real, System::kStride>) {
    // One lane visits colour after colour; one loop keeps it in step with its neighbours, whatever their colours are.
    for (Index p = 0; p < s.contacts; ++p) largest = max_(visit_contact(env, s, p, omega), largest);
  } else {
    for (Index color = 0; color < env.color_count; ++color) {
      const Index first = env.color_offsets[color];
      share_out(block, env.color_offsets[color + 1] - first, [&](Index k) {
        for (Index p = env.vertex_offsets[first + k]; p < env.vertex_offsets[first + k + 1]; ++p)
          largest = max_(visit_contact(env, s, p, omega), largest);
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

/// Computes twists afresh from the impulses, so that rounding does not pile up in them; momentum's earlier twists get
/// the same correction (docs/math/npgs.md, "Refreshing motion together with its history").
template <Block B, class Real, Law kLaw, int kStride>
STICTION_HD_OUTLINE void refresh_bodies(B& block, const BodyEnv<Real>& env, const BodySystem<Real, kLaw, kStride>& s,
                                        const SiParams& params) {
  for_each(block, s.bodies, [&](Index body) {
    const Twist<double> free = free_twist(env, s, params, body);
    const Twist<Real> base{
        {static_cast<Real>(free.linear.x), static_cast<Real>(free.linear.y), static_cast<Real>(free.linear.z)},
        {static_cast<Real>(free.angular.x), static_cast<Real>(free.angular.y), static_cast<Real>(free.angular.z)}};
    const Twist<Real> fresh =
        gather_impulses(env, body, base, s.inverse_mass(body), [&](Index p, bool is_b, Vector3<Real>& arm) {
          const auto visit = visit_of(env, s, p);
          arm = is_b ? visit.arm_b : visit.arm_a;
          const Real x[3] = {s.x.at(0, p), s.x.at(1, p), s.x.at(2, p)};
          return impulse_of(visit, x);
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

/// The largest natural-map residual over the contacts [w], for fresh twists.
template <Block B, class Env, class System>
STICTION_HD_OUTLINE auto estimate_residual(B& block, const Env& env, const System& s) {
  using Real = typename System::Real;
  Real largest(0);
  share_out(block, s.contacts, [&](Index p) {
    const auto visit = visit_of(env, s, p);
    const Real x[3] = {s.x.at(0, p), s.x.at(1, p), s.x.at(2, p)};
    Real y[3];
    motion_of(s, visit, s.field.at(kFieldBias, p), s.twist(s.motion, slot_of(visit.side_a)),
              s.twist(s.motion, slot_of(visit.side_b)), x, y);
    largest =
        max_(natural_map<System::kLaw>(ContactShape{}, x, y, s.field.at(kFieldWeight, p), Real(0), Real(0)), largest);
  });
  return block.max(largest);
}

}  // namespace stiction::inline STICTION_ISA
