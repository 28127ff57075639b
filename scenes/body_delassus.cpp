#include <algorithm>

#include "scenes/body_scenes.hpp"
#include "scenes/geometry.hpp"

// Written from docs/howto/bodies.md and from no header of core/algorithm: it checks the matrix-free
// solver.

namespace stiction::scenes {
namespace {

using Env = BodyEnvironment<double>;

Vec3 as_vector(const std::array<double, 3>& a) {
  return {a[0], a[1], a[2]};
}

/// Columns of a symmetric matrix stored as xx, xy, xz, yy, yz, zz.
Mat3 full(const std::array<double, 6>& m) {
  return {{m[0], m[1], m[2]}, {m[1], m[3], m[4]}, {m[2], m[4], m[5]}};
}

/// Velocity of a body's point.
Vec3 velocity_at(const Env& env, Index body, Vec3 arm) {
  if (body < 0) return {};
  const auto& twist = env.bodies[static_cast<std::size_t>(body)].twist;
  return Vec3{twist[0], twist[1], twist[2]} + cross(Vec3{twist[3], twist[4], twist[5]}, arm);
}

double wanted_velocity(const Env& env, const Env::Contact& contact, const TimeStepping& stepping) {
  const Vec3 relative = velocity_at(env, contact.body_b, as_vector(contact.arm_b)) -
                        velocity_at(env, contact.body_a, as_vector(contact.arm_a));
  const double approach = -dot(relative, as_vector(contact.normal));
  double wanted = contact.depth < 0 ? contact.depth / stepping.dt
                                    : stepping.erp * std::max(contact.depth - stepping.slop, 0.0) / stepping.dt;
  const bool reaches = approach * stepping.dt >= -contact.depth;
  if (contact.restitution > 0 && approach > stepping.restitution_threshold && reaches)
    wanted = std::max(wanted, contact.restitution * approach);
  return wanted;
}

}  // namespace

BodyMatrices body_matrices(const Env& env) {
  BodyMatrices m;
  m.rows = 3 * static_cast<Index>(env.contacts.size());
  m.dofs = 6 * static_cast<Index>(env.bodies.size());
  const auto dofs = static_cast<std::size_t>(m.dofs);
  m.J.assign(static_cast<std::size_t>(m.rows) * dofs, 0);
  m.inv_M.assign(dofs * dofs, 0);
  m.v_free.assign(dofs, 0);
  for (std::size_t k = 0; k < env.bodies.size(); ++k) {
    const auto& body = env.bodies[k];
    for (std::size_t i = 0; i < 6; ++i)
      m.v_free[6 * k + i] = body.twist[i] + (body.kinematic ? 0.0 : body.twist_change[i]);
    if (body.kinematic) continue;
    const Mat3 inertia = full(body.inv_inertia);
    const Vec3 columns[3] = {inertia.x, inertia.y, inertia.z};
    for (std::size_t i = 0; i < 3; ++i) {
      m.inv_M[(6 * k + i) * dofs + 6 * k + i] = body.inv_mass;
      const double entries[3] = {columns[i].x, columns[i].y, columns[i].z};
      for (std::size_t j = 0; j < 3; ++j) m.inv_M[(6 * k + 3 + i) * dofs + 6 * k + 3 + j] = entries[j];
    }
  }
  for (std::size_t c = 0; c < env.contacts.size(); ++c) {
    const auto& contact = env.contacts[c];
    const double n[3] = {contact.normal[0], contact.normal[1], contact.normal[2]};
    double t1[3];
    double t2[3];
    contact_tangents(n, t1, t2);
    const Vec3 direction[3] = {{n[0], n[1], n[2]}, {t1[0], t1[1], t1[2]}, {t2[0], t2[1], t2[2]}};
    for (std::size_t r = 0; r < 3; ++r) {
      double* row = m.J.data() + (3 * c + r) * dofs;
      const auto add = [&](Index body, Vec3 arm, double sign) {
        if (body < 0) return;
        const Vec3 turn = cross(arm, direction[r]);
        const double entries[6] = {direction[r].x, direction[r].y, direction[r].z, turn.x, turn.y, turn.z};
        for (std::size_t i = 0; i < 6; ++i) row[6 * static_cast<std::size_t>(body) + i] += sign * entries[i];
      };
      add(contact.body_b, as_vector(contact.arm_b), 1);
      add(contact.body_a, as_vector(contact.arm_a), -1);
    }
  }
  return m;
}

Environment<double> delassus_form(const Env& env, const TimeStepping& stepping) {
  const BodyMatrices m = body_matrices(env);
  const auto rows = static_cast<std::size_t>(m.rows), dofs = static_cast<std::size_t>(m.dofs);
  // Y = J M^-1; a body's block is six columns wide.
  std::vector<double> y(rows * dofs, 0);
  for (std::size_t i = 0; i < rows; ++i)
    for (std::size_t j = 0; j < dofs; ++j) {
      const std::size_t block = j / 6 * 6;
      for (std::size_t k = block; k < block + 6; ++k) y[i * dofs + j] += m.J[i * dofs + k] * m.inv_M[k * dofs + j];
    }
  Environment<double> system;
  std::vector<double> a(rows * rows, 0);
  for (std::size_t i = 0; i < rows; ++i)
    for (std::size_t j = 0; j < rows; ++j)
      for (std::size_t k = 0; k < dofs; ++k) a[i * rows + j] += y[i * dofs + k] * m.J[j * dofs + k];
  system.set_dense(a, m.rows);
  for (std::size_t c = 0; c < env.contacts.size(); ++c) {
    system.cones.push_back({ConeKind::friction, 3, -1});
    for (std::size_t r = 0; r < 3; ++r) {
      double b = r == 0 ? -wanted_velocity(env, env.contacts[c], stepping) : 0.0;
      for (std::size_t k = 0; k < dofs; ++k) b += m.J[(3 * c + r) * dofs + k] * m.v_free[k];
      system.b.push_back(b);
      system.R.push_back(stepping.cfm / stepping.dt);
      system.mu.push_back(r == 0 ? 0.0 : env.contacts[c].mu);
    }
  }
  return system;
}

}  // namespace stiction::scenes
