#pragma once

#include "core/algorithm/linear/line_search.hpp"
#include "core/algorithm/newton/cone_response.hpp"
#include "core/algorithm/rigid/newton/space_room.hpp"

/// The function that Newton's method minimises, its gradient and how it bends along a line (docs/math/body_newton.md).
namespace stiction::inline STICTION_ISA {

/// J p for one contact and a vector of twists: rows n, t1, t2. A body that is not pushed has no change.
STICTION_HD void relative_motion(const SpaceContact& contact, const double* twists, double (&rows)[3]) {
  Vector3<double> u{0.0, 0.0, 0.0};
  if (is_pushed(contact.side_b)) u = point_velocity(SpaceWorkspace::twist(twists, contact.side_b), contact.arm_b);
  if (is_pushed(contact.side_a))
    u = subtract(u, point_velocity(SpaceWorkspace::twist(twists, contact.side_a), contact.arm_a));
  rows[0] = dot(u, contact.frame.n);
  rows[1] = dot(u, contact.frame.t1);
  rows[2] = dot(u, contact.frame.t2);
}

/// Computes the vector whose projection is the reaction to a motion u, which holds the shift.
STICTION_HD void unprojected(const SpaceContact& contact, const double (&u)[3], double compliance, double (&z)[3]) {
  const double whole = compliance + contact.prox_weight;
  for (int k = 0; k < 3; ++k) z[k] = div_(fma_(contact.prox_weight, contact.prox_center[k], 0.0 - u[k]), whole);
}

/// J' of the contacts' impulses for one body: force and torque. `impulse_of(contact, row)` gives the impulse on b.
template <class F>
STICTION_HD Twist<double> gather_wrench(const SpaceWorkspace& workspace, Index row, F&& impulse_of) {
  Twist<double> wrench{{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  const BlockPattern& pattern = workspace.stream.pattern;
  for (Index block = pattern.offsets[row]; block < pattern.offsets[row + 1]; ++block) {
    if (pattern.columns[block] != row) continue;
    for (Index k = workspace.stream.block_offsets[block]; k < workspace.stream.block_offsets[block + 1]; ++k) {
      const Index entry = workspace.stream.block_contacts[k];
      const bool is_b = entry >= 0;
      const SpaceContact& contact = workspace.contact[is_b ? entry : ~entry];
      const double sign = is_b ? 1.0 : -1.0;
      const double* const x = impulse_of(contact);
      const Vector3<double> impulse = to_world(contact.frame, sign * x[0], sign * x[1], sign * x[2]);
      wrench.linear = add_scaled(wrench.linear, 1.0, impulse);
      wrench.angular = add_cross(wrench.angular, is_b ? contact.arm_b : contact.arm_a, impulse);
    }
  }
  return wrench;
}

/// M p of one body.
STICTION_HD Twist<double> momentum_of(const SpaceBody& body, const Twist<double>& p) {
  const Vector3<double> zero{0.0, 0.0, 0.0};
  return {add_scaled(zero, body.mass, p.linear), add_product(zero, body.inertia, p.angular)};
}

/// Minus a body's part of the gradient, as a twist and as a force.
STICTION_HD void renew_descent_of(const SpaceWorkspace& workspace, Index row) {
  const Twist<double> p = SpaceWorkspace::twist(workspace.point, row);
  const Twist<double> wrench =
      gather_wrench(workspace, row, [](const SpaceContact& contact) { return contact.reaction; });
  const Twist<double> still{{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  const Twist<double> moved = pushed(still, workspace.body[row].inverse, wrench.linear, wrench.angular);
  const Twist<double> descent{subtract(moved.linear, p.linear), subtract(moved.angular, p.angular)};
  put_twist(workspace.descent + static_cast<Offset>(row) * kBodyBlock, descent);
  put_twist(workspace.force + static_cast<Offset>(row) * kBodyBlock, momentum_of(workspace.body[row], descent));
}

/// Descent and force for the reactions that are there.
template <Team TeamT>
STICTION_HD_OUTLINE void renew_descent(TeamT& team, const SpaceWorkspace& workspace) {
  for_each(team, workspace.bodies, [&](Index row) { renew_descent_of(workspace, row); });
}

/// Motion, with its shift, at workspace.point. Steps add their changes to it. Recomputed, its rounding would be that
/// of the velocities, and a stiff contact answers to it (docs/math/body_newton.md, "Rounding").
template <Team TeamT>
STICTION_HD_OUTLINE void renew_space_motion(TeamT& team, const SpaceWorkspace& workspace) {
  for_each(team, workspace.contacts, [&](Index p) {
    SpaceContact& contact = workspace.contact[p];
    double u[3];
    relative_motion(contact, workspace.point, u);
    for (int k = 0; k < 3; ++k) contact.u[k] = (u[k] + contact.free[k]) + (k == 0 ? contact.shift : 0.0);
  });
}

/// The reaction to a contact's motion, and the shift it would have.
STICTION_HD void answer_motion(SpaceContact& contact, Law law, double compliance) {
  unprojected(contact, contact.u, compliance, contact.z);
  const ConePoint point = project_friction_cone(contact.z, contact.mu);
  double slide[3];
  for (int k = 0; k < 3; ++k) {
    contact.reaction[k] = point.x[k];
    slide[k] = fma_(compliance, point.x[k], contact.u[k]);
  }
  // A contact that is held does not slide: the rest of its motion goes with the proximal term.
  contact.sliding =
      point.is_inside || law == Law::convex ? 0.0 : contact.mu * sqrt_(fma_(slide[2], slide[2], slide[1] * slide[1]));
}

/// The largest component of a contact's motion under those twists [w].
STICTION_HD double largest_motion(const SpaceContact& contact, const double* twists) {
  double change[3];
  relative_motion(contact, twists, change);
  return max_(abs_(change[0]), max_(abs_(change[1]), abs_(change[2])));
}

/// Reactions, descent and force at workspace.point, whose motion is there. Returns the largest relative velocity that
/// the descent would bring to a contact [w]: zero where the gradient is.
template <Team TeamT>
STICTION_HD_OUTLINE double renew_reactions(TeamT& team, const SpaceWorkspace& workspace, double compliance) {
  for_each(team, workspace.contacts, [&](Index p) { answer_motion(workspace.contact[p], workspace.law, compliance); });
  renew_descent(team, workspace);
  return max_over<double>(team, workspace.contacts,
                          [&](Index p) { return largest_motion(workspace.contact[p], workspace.descent); });
}

/// d'Md of one body.
STICTION_HD double curvature_of_body(const SpaceWorkspace& workspace, Index row) {
  const Twist<double> d = SpaceWorkspace::twist(workspace.step, row);
  const Twist<double> momentum = momentum_of(workspace.body[row], d);
  return dot(momentum.linear, d.linear) + dot(momentum.angular, d.angular);
}

/// d'Md: the curvature that bodies add, everywhere on the line.
template <Team TeamT>
STICTION_HD_OUTLINE double body_curvature(TeamT& team, const SpaceWorkspace& workspace) {
  return sum_leaves<double>(team, [&](Index leaf) {
    double part = 0.0;
    for (Index row = leaf; row < workspace.bodies; row += kReduceLeaves)
      part = part + curvature_of_body(workspace, row);
    return part;
  });
}

/// Returns a contact's part of slope and curvature at a place of the line.
STICTION_HD LinePoint look_along(const SpaceContact& contact, double compliance, double alpha) {
  double u[3];
  for (int k = 0; k < 3; ++k) u[k] = fma_(alpha, contact.along[k], contact.u[k]);
  double z[3];
  unprojected(contact, u, compliance, z);
  const ConePoint point = project_friction_cone(z, contact.mu);
  LinePoint part{0.0, 0.0};
  for (int i = 0; i < 3; ++i) {
    double image = 0.0;
    for (int j = 0; j < 3; ++j) image = fma_(point.P[i][j], contact.along[j], image);
    part.slope = fma_(0.0 - contact.along[i], point.x[i], part.slope);
    part.curvature = fma_(contact.along[i], image, part.curvature);
  }
  part.curvature = div_(part.curvature, compliance + contact.prox_weight);
  return part;
}

/// Slope and curvature at a place of the line: those of bodies at 0, and those of contacts there.
STICTION_HD LinePoint at_place(const LinePoint& bodies, const LinePoint& contacts, double alpha) {
  return {fma_(alpha, bodies.curvature, bodies.slope) + contacts.slope, bodies.curvature + contacts.curvature};
}

/// `bodies`: their part at alpha = 0.
template <Team TeamT>
STICTION_HD_OUTLINE LinePoint evaluate_along(TeamT& team, const SpaceWorkspace& workspace, const LinePoint& bodies,
                                             double compliance, double alpha) {
  for_each(team, workspace.contacts, [&](Index p) {
    SpaceContact& contact = workspace.contact[p];
    const LinePoint part = look_along(contact, compliance, alpha);
    contact.slope = part.slope;
    contact.curvature = part.curvature;
  });
  const auto sum = [&](double SpaceContact::* part) {
    return sum_leaves<double>(team, [&](Index leaf) {
      double total = 0.0;
      for (Index p = leaf; p < workspace.contacts; p += kReduceLeaves) total = total + workspace.contact[p].*part;
      return total;
    });
  };
  const LinePoint contacts{sum(&SpaceContact::slope), sum(&SpaceContact::curvature)};
  return at_place(bodies, contacts, alpha);
}

/// `sum`, and the magnitudes that a contact's part of a slope is made of.
STICTION_HD double slope_terms(const SpaceContact& contact, double compliance, double sum) {
  for (int k = 0; k < 3; ++k) {
    const double answer = abs_(contact.reaction[k]) + div_(abs_(contact.u[k]), compliance + contact.prox_weight);
    sum = fma_(abs_(contact.along[k]), answer, sum);
  }
  return sum;
}

/// Rounding of a slope that is zero: 4 eps times the sum of the magnitudes it is made of. A stiff contact answers to
/// the rounding of its motion as it does to motion.
template <Team TeamT>
STICTION_HD_OUTLINE double slope_noise(TeamT& team, const SpaceWorkspace& workspace, double compliance) {
  const double sum = sum_leaves<double>(team, [&](Index leaf) {
    double part = 0.0;
    for (Index p = leaf; p < workspace.contacts; p += kReduceLeaves)
      part = slope_terms(workspace.contact[p], compliance, part);
    return part;
  });
  return 0x1p-50 * sum;
}

/// Part of the slope at the beginning of a line that may be left where it ends.
inline constexpr double kSpaceSlopeLeft = 1e-2;

/// The alpha at which the function is smallest on the line.
template <Team TeamT>
STICTION_HD_OUTLINE double search_along(TeamT& team, const SpaceWorkspace& workspace, const LinePoint& bodies,
                                        double compliance, double slope, double noise) {
  return search_line([&](double alpha) { return evaluate_along(team, workspace, bodies, compliance, alpha); }, slope,
                     kSpaceSlopeLeft, noise);
}

/// A contact's motion at the end of the line, and one number of a body.
STICTION_HD void follow_line(SpaceContact& contact, double alpha) {
  for (int k = 0; k < 3; ++k) contact.u[k] = fma_(alpha, contact.along[k], contact.u[k]);
}
STICTION_HD double follow_line(double from, double step, double alpha) {
  return fma_(alpha, step, from);
}

}  // namespace stiction::inline STICTION_ISA
