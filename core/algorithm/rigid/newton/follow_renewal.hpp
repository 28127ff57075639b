#pragma once

#include "core/algorithm/newton/outer_loop.hpp"
#include "core/algorithm/rigid/newton/body_hessian.hpp"
#include "core/algorithm/rigid/newton/precondition.hpp"

namespace stiction::inline STICTION_ISA {

/// A contact's answer to a change of motion with its shift s = mu norm(w_t) going along (docs/math/body_newton.md,
/// (7)). With e the normal row, dz = first - (1 + e r')^-1 (1 + e sigma') J d / c.
struct FollowedContact {
  double P[3][3];
  double sigma[3];  ///< mu times the unit direction of sliding; zero where the shift is kept
  double r[3];      ///< R P sigma / c
  double first[3];  ///< dz without a change of velocities
  double whole;     ///< c
};

/// (1 + e r')^-1 x, in place. r_n is at least -mu^2 / (1 + mu^2).
STICTION_HD void divide_by_shift(const FollowedContact& followed, double (&x)[3]) {
  const double along = fma_(followed.r[2], x[2], fma_(followed.r[1], x[1], followed.r[0] * x[0]));
  x[0] = x[0] - div_(along, 1.0 + followed.r[0]);
}

/// The reactions are still those before the renewal, and are its centre too.
STICTION_HD FollowedContact followed_contact(const SpaceContact& contact, double compliance, bool with_sliding) {
  FollowedContact followed;
  const ConePoint point = project_friction_cone(contact.z, contact.mu);
  followed.whole = compliance + contact.prox_weight;
  double slide[3] = {};
  for (int k = 1; k < 3; ++k) slide[k] = fma_(compliance, contact.prox_center[k], contact.u[k]);
  const double length = sqrt_(fma_(slide[2], slide[2], slide[1] * slide[1]));
  const bool turns = with_sliding && contact.sliding > 0.0 && length > 0.0;
  const double part = div_(compliance, followed.whole);
  for (int k = 0; k < 3; ++k) followed.sigma[k] = turns ? contact.mu * div_(slide[k], length) : 0.0;
  for (int k = 0; k < 3; ++k) {
    for (int j = 0; j < 3; ++j) followed.P[k][j] = point.P[k][j];
    followed.r[k] = part * fma_(followed.sigma[2], point.P[2][k], followed.sigma[1] * point.P[1][k]);
  }
  unprojected(contact, contact.u, compliance, followed.first);
  followed.first[0] = followed.first[0] + div_(contact.shift - contact.sliding, followed.whole);
  for (int k = 0; k < 3; ++k) followed.first[k] = followed.first[k] - contact.z[k];
  divide_by_shift(followed, followed.first);
  return followed;
}

/// W of a contact whose shift follows, P (1 + e r')^-1 (1 + e sigma') / c, in world axes.
STICTION_HD void turn_followed_stiffness(SpaceContact& contact, const FollowedContact& followed) {
  double W[3][3];
  for (int j = 0; j < 3; ++j) {
    double x[3] = {followed.sigma[j], 0.0, 0.0};
    x[j] = x[j] + 1.0;
    divide_by_shift(followed, x);
    for (int i = 0; i < 3; ++i)
      W[i][j] = fma_(followed.P[i][2], x[2], fma_(followed.P[i][1], x[1], followed.P[i][0] * x[0]));
  }
  turn_stiffness(contact, W, div_(1.0, followed.whole));
}

/// Returns the shift after the motion has changed by d.
STICTION_HD double followed_shift(const SpaceContact& contact, const FollowedContact& followed, double compliance,
                                  const double (&d)[3]) {
  double x[3] = {fma_(followed.sigma[2], d[2], fma_(followed.sigma[1], d[1], d[0])), d[1], d[2]};
  for (int k = 0; k < 3; ++k) x[k] = div_(0.0 - x[k], followed.whole);
  divide_by_shift(followed, x);
  double slide[3] = {};
  for (int i = 1; i < 3; ++i) {
    double reaction = contact.prox_center[i];
    for (int j = 0; j < 3; ++j) reaction = fma_(followed.P[i][j], followed.first[j] + x[j], reaction);
    slide[i] = fma_(compliance, reaction, contact.u[i] + d[i]);
  }
  return contact.mu * sqrt_(fma_(slide[2], slide[2], slide[1] * slide[1]));
}

/// Before the system of a renewal is solved: the reaction without a change of velocities, and W.
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

/// The first step after a renewal: the new problem as it would be if no contact changed how it is held, sliding or
/// open. The motion by weights and shifts is linear then, and needs no line search; terms that the step overlooks are
/// left to the next. With sliding, shifts follow the velocities within the step, which makes it one of Newton's method
/// on Coulomb's law itself. Without, they become their proper values before it.
template <Team TeamT>
STICTION_HD_OUTLINE void follow_renewal(TeamT& team, const SpaceWorkspace& workspace, const BodySpaceOptions& space,
                                        double compliance, bool with_sliding) {
  assemble_curvature(team, workspace, compliance);
  for_each(team, workspace.contacts, [&](Index p) { prepare_renewal(workspace.contact[p], compliance, with_sliding); });
  renew_descent(team, workspace);
  if (with_sliding) assemble_sliding(team, workspace);
  solve_space(team, workspace, space, with_sliding ? SpaceSystem::sliding : SpaceSystem::symmetric, kRenewalTolerance);
  for_each(team, workspace.contacts,
           [&](Index p) { finish_renewal(workspace, workspace.contact[p], compliance, with_sliding); });
  for_each(team, workspace.bodies * kBodyBlock,
           [&](Index i) { workspace.point[i] = workspace.point[i] + workspace.step[i]; });
}

}  // namespace stiction::inline STICTION_ISA
