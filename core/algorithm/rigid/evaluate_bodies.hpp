#pragma once

#include "core/algorithm/driver/check_convergence.hpp"
#include "core/algorithm/residual/final_residual.hpp"
#include "core/algorithm/rigid/load_bodies.hpp"

/// Answer and its error, in double and matrix-free, from the batch's own numbers.
namespace stiction::inline STICTION_ISA {

/// The impulse that is returned for row k of a contact if `x` is the best iterate, to the bit.
template <class Real, int kStride>
STICTION_HD Real returned_impulse(const BodyEnv<Real>& env, const ContactTiles<Real, kStride>& x, Index p, Index k) {
  const Real value = x.at(k, p);
  return canonical_zero(k == 0 ? value : value * env.mu[env.contact_order[p]]);
}

/// Twists under those impulses, v_free + M^-1 J' lambda, into s.exact.
template <Team TeamT, class Real, Law kLaw, int kStride>
STICTION_HD void gather_exact(TeamT& team, const BodyEnv<Real>& env, const BodySystem<Real, kLaw, kStride>& s,
                              const ContactTiles<Real, kStride>& x, const SiParams& params) {
  for_each(team, s.bodies + 1, [&](Index body) {
    Twist<double> twist = free_twist(env, s, params, body);
    if (body < s.bodies && !env.is_kinematic(body)) {
      const InverseMass<double> inverse{static_cast<double>(env.inv_mass[body]),
                                        load6<double>(env.inv_inertia + 6 * static_cast<Offset>(body))};
      twist = gather_impulses(env, body, twist, inverse, [&](Index p, bool is_b, Vector3<double>& arm) {
        const ExactContact contact = exact_contact(env, p);
        arm = is_b ? contact.arm_b : contact.arm_a;
        return to_world(contact.frame, static_cast<double>(returned_impulse(env, x, p, 0)),
                        static_cast<double>(returned_impulse(env, x, p, 1)),
                        static_cast<double>(returned_impulse(env, x, p, 2)));
      });
    }
    put_twist(s.exact_row(body), twist);
  });
}

template <class Real>
STICTION_HD InverseMass<double> exact_mass(const BodyEnv<Real>& env, Index side) {
  if (!is_pushed(side)) return {0.0, {0.0, 0.0, 0.0, 0.0, 0.0, 0.0}};
  return {static_cast<double>(env.inv_mass[side]), load6<double>(env.inv_inertia + 6 * static_cast<Offset>(side))};
}

/// Judges a contact's reaction `lambda`; `r` is R. Finds its motion. twist(side) is the twist of a body under all
/// reactions, 0 for a and 1 for b. mass(side) is its inverse mass and bias() the contact's bias. They are called when
/// they are needed, for no machine has registers for all of them.
template <Law kLaw, class T, class TwistOf, class MassOf, class Bias>
STICTION_HD void evaluate_contact(const ExactGeometry<T>& contact, TwistOf&& twist, MassOf&& mass, Bias&& bias, T mu,
                                  T r, const T (&lambda)[3], T (&motion)[3], T share, T unit,
                                  LargestResidual<T>& evaluated) {
  const Vector3<T> u = relative_velocity(twist(0), contact.arm_a, twist(1), contact.arm_b);
  const T along[3] = {dot(u, contact.frame.n) + bias(), dot(u, contact.frame.t1), dot(u, contact.frame.t2)};
  ContactBlock<T> block{T(0), T(0), T(0), T(0), T(0), T(0)};
  add_body(block, mass(0), contact.arm_a, contact.frame);
  add_body(block, mass(1), contact.arm_b, contact.frame);
  T reaction[3];
  T y[3];
  for (int k = 0; k < 3; ++k) {
    motion[k] = fma_(r, lambda[k], along[k]);
    reaction[k] = k == 0 ? lambda[k] : unit_reaction(lambda[k], mu);
    y[k] = k == 0 ? motion[k] : mu * motion[k];
  }
  const T a = max_(block.nn + r, T(0));
  const auto first = axis_weights(a, block.t11 + r, mu), second = axis_weights(a, block.t22 + r, mu);
  const ConeMetric<T, 3> metric{a, {T(1), first.press, second.press}, {T(1), first.slip, second.slip}};
  evaluated.template add<kLaw>(ContactShape{}, reaction, y, metric, T(kLowerBound<Scalar<T>, kLaw>), T(0), share, unit);
}

/// Writes s.exact and, if it is an answer, env.w; judges the iterate `x`.
template <Team TeamT, class Real, Law kLaw, int kStride>
STICTION_HD_OUTLINE FinalResidual residual_of(TeamT& team, const BodyEnv<Real>& env,
                                              const BodySystem<Real, kLaw, kStride>& s,
                                              const ContactTiles<Real, kStride>& x, const SiParams& params,
                                              const ErrorScale& scale, bool is_answer) {
  gather_exact(team, env, s, x, params);
  const double r = div_(params.cfm, params.step);
  LargestResidual<double> evaluated;
  for_each_tiled(team, s.contacts, [&](Index p) {
    const ExactContact contact = exact_contact(env, p);
    double lambda[3];
    for (Index k = 0; k < 3; ++k) lambda[k] = static_cast<double>(returned_impulse(env, x, p, k));
    double motion[3];
    const auto side = [&](int k) { return k == 0 ? contact.side_a : contact.side_b; };
    evaluate_contact<kLaw, double>(
        contact, [&](int k) { return twist_at<double>(s.exact_row(slot_of(side(k)))); },
        [&](int k) { return exact_mass(env, side(k)); }, [&] { return bias_of(env, s, params, p, contact); },
        static_cast<double>(env.mu[contact.contact]), r, lambda, motion,
        static_cast<double>(s.field.at(kFieldShare, p)), scale.unit, evaluated);
    for (Index k = 0; is_answer && env.w != nullptr && k < 3; ++k)
      env.w[3 * static_cast<Offset>(contact.contact) + k] = canonical_zero(saturated<Real>(motion[k]));
  });
  return final_residual_of(team, evaluated, scale);
}

/// Returns the allowance of an answer.
STICTION_HD Allowance allowance(const SiParams& params) {
  return {params.tolerance, params.absolute_tolerance};
}
/// The verdict on the best iterate, which is the answer.
template <Team TeamT, class Real, Law kLaw, int kStride>
STICTION_HD Verdict evaluate_bodies(TeamT& team, const BodyEnv<Real>& env, const BodySystem<Real, kLaw, kStride>& s,
                                    const SiParams& params, const ErrorScale& scale) {
  return judge<Real>(residual_of(team, env, s, s.best, params, scale, true), scale.largest, allowance(params));
}

/// Writes impulses and twists; the impulses of earlier sub-steps are in env.impulse already. Each is finite, and their
/// sum may not be. (A sum of two floats in double is rounded once all the same: 53 bits are at least 2 * 24 + 2.)
template <Team TeamT, class Real, Law kLaw, int kStride>
STICTION_HD_OUTLINE void write_bodies(TeamT& team, const BodyEnv<Real>& env, const BodySystem<Real, kLaw, kStride>& s) {
  for_each_tiled(team, s.contacts, [&](Index p) {
    for (Index k = 0; k < 3; ++k) {
      Real& total = env.impulse[3 * static_cast<Offset>(env.contact_order[p]) + k];
      const double sum = static_cast<double>(total) + static_cast<double>(returned_impulse(env, s.best, p, k));
      total = canonical_zero(saturated<Real>(sum));
    }
  });
  for_each(team, s.bodies, [&](Index body) {
    const auto row = s.exact_row(body);
    for (Index k = 0; k < 6; ++k)
      env.twist_out[6 * static_cast<Offset>(body) + k] = canonical_zero(saturated<Real>(row[k]));
  });
}

/// Zero impulses, and zero motion of the contacts: the start of the sums, and the numbers of a dropped contact.
template <Team TeamT, class Real>
STICTION_HD void clear_impulses(TeamT& team, const BodyEnv<Real>& env) {
  for_each(team, env.contacts, [&](Index c) {
    for (Index k = 0; k < 3; ++k) {
      env.impulse[3 * static_cast<Offset>(c) + k] = Real(0);
      if (env.w != nullptr) env.w[3 * static_cast<Offset>(c) + k] = Real(0);
    }
  });
}

template <Team TeamT, class Real>
STICTION_HD void write_body_status(TeamT& team, const BodyEnv<Real>& env, const SiParams& params, EnvCode code,
                                   std::uint32_t flags, Index iterations, double relative, double absolute) {
  single(team,
         [&] { *env.status = EnvStatus{relative, absolute, flags, iterations, code, params.answered_by, {0, 0}, 0}; });
}

/// The safe answer for an environment whose numbers cannot be used: nothing pushes, nothing moves.
template <Team TeamT, class Real>
STICTION_HD_OUTLINE void reject_bodies(TeamT& team, const BodyEnv<Real>& env, const SiParams& params,
                                       std::uint32_t flags) {
  for_each(team, env.bodies, [&](Index body) {
    for (Index k = 0; k < 6; ++k) env.twist_out[6 * static_cast<Offset>(body) + k] = Real(0);
  });
  const double infinite = __builtin_huge_val();
  write_body_status(team, env, params, EnvCode::invalid_input, flags, 0, infinite, infinite);
}

}  // namespace stiction::inline STICTION_ISA
