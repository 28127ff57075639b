#pragma once

#include "core/algorithm/rigid/evaluate_bodies.hpp"
#include "core/algorithm/rigid/newton/body_gradient.hpp"

/// From the batch's arrays to numbers that Newton's method in body space can work with.
namespace stiction::inline STICTION_ISA {

/// In some direction a body's inverse inertia, or its inverse mass, may be below this part of the largest. Its mass
/// matrix is then as if it were that part: below, rounding would make as much of it. Reactions answer the inverse as
/// it is.
inline constexpr double kLeastInverse = 1e-9;

/// The inverse of a symmetric positive semidefinite matrix whose pivots are kept from zero, by L D L'.
STICTION_HD Symmetric3<double> inverse_above(const Symmetric3<double>& m, double least) {
  const double d0 = max_(m.xx, least);
  const double l1 = div_(m.xy, d0);
  const double l2 = div_(m.xz, d0);
  const double d1 = max_(fma_(0.0 - l1, m.xy, m.yy), least);
  const double l3 = div_(fma_(0.0 - l1, m.xz, m.yz), d1);
  const double d2 = max_(fma_(0.0 - (l3 * d1), l3, fma_(0.0 - l2, m.xz, m.zz)), least);
  // Columns of L^-1: (1, -l1, l1 l3 - l2), (0, 1, -l3), (0, 0, 1).
  const double corner = fma_(l1, l3, 0.0 - l2);
  const double e0 = div_(1.0, d0);
  const double e1 = div_(1.0, d1);
  const double e2 = div_(1.0, d2);
  return {fma_(corner * e2, corner, fma_(l1 * e1, l1, e0)),
          fma_(corner * e2, 0.0 - l3, 0.0 - l1 * e1),
          corner * e2,
          fma_(l3 * e2, l3, e1),
          0.0 - l3 * e2,
          e2};
}

STICTION_HD double largest_moment(const Symmetric3<double>& inertia) {
  return max_(inertia.xx, max_(inertia.yy, inertia.zz));
}

/// Inverse masses as they are, and mass matrices.
template <Team TeamT, class Real>
STICTION_HD_OUTLINE void load_space_bodies(TeamT& team, const BodyEnv<Real>& env, const SpaceWorkspace& workspace) {
  const auto inverse_of = [&](Index row) { return exact_mass(env, env.is_kinematic(row) ? ~row : row); };
  const double most_mass = max_over<double>(team, workspace.bodies, [&](Index row) { return inverse_of(row).mass; });
  const double most_inertia =
      max_over<double>(team, workspace.bodies, [&](Index row) { return largest_moment(inverse_of(row).inertia); });
  for_each(team, workspace.bodies, [&](Index row) {
    SpaceBody& body = workspace.body[row];
    body.inverse = inverse_of(row);
    body.mass = 1.0;
    body.inertia = {1.0, 0.0, 0.0, 1.0, 0.0, 1.0};
    if (env.is_kinematic(row)) return;
    const Symmetric3<double>& inertia = body.inverse.inertia;
    const double own = largest_moment(inertia);
    const double least = kLeastInverse * (own > 0.0 ? own : most_inertia);
    body.mass = div_(1.0, max_(max_(body.inverse.mass, kLeastInverse * most_mass), 0x1p-500));
    body.inertia = inverse_above(inertia, max_(least, 0x1p-500));
  });
}

/// Geometry, friction and weight of contacts.
template <Team TeamT, class Real>
STICTION_HD_OUTLINE void load_space_contacts(TeamT& team, const BodyEnv<Real>& env, const SiParams& params,
                                             const SpaceWorkspace& workspace) {
  const double compliance = div_(params.cfm, params.step);
  for_each(team, workspace.contacts, [&](Index p) {
    SpaceContact& contact = workspace.contact[p];
    const ExactContact exact = exact_contact(env, p);
    contact.side_a = exact.side_a;
    contact.side_b = exact.side_b;
    contact.arm_a = exact.arm_a;
    contact.arm_b = exact.arm_b;
    contact.frame = exact.frame;
    contact.mu = static_cast<double>(env.mu[exact.contact]);
    ContactBlock<double> own{0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    add_body(own, exact_mass(env, exact.side_a), exact.arm_a, exact.frame);
    add_body(own, exact_mass(env, exact.side_b), exact.arm_b, exact.frame);
    const double mean = div_((own.nn + own.t11) + own.t22, 3.0) + compliance;
    contact.mean = mean > 0.0 ? mean : 1.0;  // of a contact that is held, and carries nothing
  });
}

/// Positions of bodies if contacts touch: arms lead from the lowest body of every island to all others.
template <Team TeamT>
STICTION_HD_OUTLINE void place_bodies(TeamT& team, const SpaceWorkspace& workspace) {
  const NewtonStream& stream = workspace.stream;
  for (Index level = 0; level < stream.levels; ++level) {
    const Index first = stream.level_offsets[level];
    for_each(team, stream.level_offsets[level + 1] - first, [&](Index k) {
      double* const place = workspace.positions + 3 * static_cast<Offset>(stream.level_bodies[first + k]);
      Vector3<double> x{0.0, 0.0, 0.0};
      if (level > 0) {
        const Index link = stream.level_links[first + k];
        const SpaceContact& contact = workspace.contact[link >= 0 ? link : ~link];
        const Index other = link >= 0 ? contact.side_a : contact.side_b;
        const Vector3<double> step =
            subtract(link >= 0 ? contact.arm_a : contact.arm_b, link >= 0 ? contact.arm_b : contact.arm_a);
        x = add_scaled(load3<double>(workspace.positions + 3 * static_cast<Offset>(other)), 1.0, step);
      }
      place[0] = x.x;
      place[1] = x.y;
      place[2] = x.z;
    });
  }
}

/// Prepares a sub-step.
template <Team TeamT, class Real, Law kLaw>
STICTION_HD_OUTLINE void enter_space(TeamT& team, const BodyEnv<Real>& env, const BodySystem<Real, kLaw>& s,
                                     const SiParams& params, const SpaceWorkspace& workspace) {
  for_each(team, workspace.contacts, [&](Index p) {
    SpaceContact& contact = workspace.contact[p];
    const Vector3<double> u = relative_velocity(free_twist(env, s, params, slot_of(contact.side_a)), contact.arm_a,
                                                free_twist(env, s, params, slot_of(contact.side_b)), contact.arm_b);
    contact.free[0] = is_held(s, p) ? static_cast<double>(kHeldBias)
                                    : dot(u, contact.frame.n) + bias_of(env, s, params, p, exact_contact(env, p));
    contact.free[1] = dot(u, contact.frame.t1);
    contact.free[2] = dot(u, contact.frame.t2);
    contact.shift = 0.0;
  });
}

/// A body's p under the impulses that are the centres of its contacts.
STICTION_HD void start_body(const SpaceWorkspace& workspace, Index row) {
  const Twist<double> wrench =
      gather_wrench(workspace, row, [](const SpaceContact& contact) { return contact.prox_center; });
  const Twist<double> still{{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  put_twist(workspace.point + static_cast<Offset>(row) * kBodyBlock,
            pushed(still, workspace.body[row].inverse, wrench.linear, wrench.angular));
}

/// p, the centre of the proximal term and under Coulomb's law the shifts from the impulses that s.x stands for.
template <Team TeamT, class Real, Law kLaw>
STICTION_HD_OUTLINE void start_at_iterate(TeamT& team, const BodyEnv<Real>& env, const BodySystem<Real, kLaw>& s,
                                          const SpaceWorkspace& workspace, double compliance) {
  for_each(team, workspace.contacts, [&](Index p) {
    for (Index k = 0; k < 3; ++k)
      workspace.contact[p].prox_center[k] = static_cast<double>(returned_impulse(env, s.x, p, k));
  });
  for_each(team, workspace.bodies, [&](Index row) { start_body(workspace, row); });
  if constexpr (kLaw == Law::coulomb) {
    for_each(team, workspace.contacts, [&](Index p) {
      SpaceContact& contact = workspace.contact[p];
      double u[3];
      relative_motion(contact, workspace.point, u);
      double slide[3];
      for (int k = 1; k < 3; ++k) slide[k] = fma_(compliance, contact.prox_center[k], u[k] + contact.free[k]);
      contact.shift = contact.mu * sqrt_(fma_(slide[2], slide[2], slide[1] * slide[1]));
    });
  }
}

/// s.x from the reactions, in coordinates in which the cone is the unit cone.
template <Team TeamT, class Real, Law kLaw>
STICTION_HD_OUTLINE void store_reactions(TeamT& team, const BodySystem<Real, kLaw>& s,
                                         const SpaceWorkspace& workspace) {
  for_each(team, workspace.contacts, [&](Index p) {
    const SpaceContact& contact = workspace.contact[p];
    for (Index k = 0; k < 3; ++k) {
      const double scale = k == 0 ? 1.0 : contact.mu;
      s.x.at(k, p) = canonical_zero(static_cast<Real>(scale > 0.0 ? div_(contact.reaction[k], scale) : 0.0));
    }
  });
}

}  // namespace stiction::inline STICTION_ISA
