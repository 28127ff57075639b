#include "core/runtime/batch/body_jacobian.hpp"

#include <algorithm>

#include "core/base/extents.hpp"

namespace stiction {

namespace {

/// The inverse of a symmetric matrix xx, xy, xz, yy, yz, zz, row by row; by cofactors.
std::array<double, 9> inverse(const std::array<double, 6>& m) {
  const auto [xx, xy, xz, yy, yz, zz] = m;
  const double cxx = yy * zz - yz * yz, cxy = xz * yz - xy * zz, cxz = xy * yz - xz * yy;
  const double det = xx * cxx + xy * cxy + xz * cxz;
  const double cyy = xx * zz - xz * xz, cyz = xy * xz - xx * yz, czz = xx * yy - xy * xy;
  return {cxx / det, cxy / det, cxz / det, cxy / det, cyy / det, cyz / det, cxz / det, cyz / det, czz / det};
}

/// Velocity that a contact's normal row asks for, as far as it moves (docs/howto/bodies.md).
struct Target {
  double velocity, by_depth, bounce;
};
Target target_of(const TimeStepping& stepping, double depth, double restitution, double approach) {
  const double over = depth - stepping.slop;
  const double share = depth < 0.0 ? 1.0 : (over > 0.0 ? stepping.erp : 0.0);
  const double way = depth < 0.0 ? depth : (over > 0.0 ? stepping.erp * over : 0.0);
  const Target position{way / stepping.dt, share / stepping.dt, 0.0};
  const bool bounces =
      restitution > 0.0 && approach > stepping.restitution_threshold && approach * stepping.dt >= -depth;
  if (!bounces || restitution * approach <= position.velocity) return position;
  return {restitution * approach, 0.0, restitution};
}

/// Rows of one environment's contacts.
template <class Real>
void add_contact(const BodyBatchView<Real>& bodies, Offset c, const TimeStepping& stepping, const double* twist,
                 JacobianEnvironment<double>& env, BodyJacobians& to) {
  const ContactRows rows_a = contact_rows(bodies.normal + 3 * c, bodies.arm_a + 3 * c);
  const ContactRows rows_b = contact_rows(bodies.normal + 3 * c, bodies.arm_b + 3 * c);
  double approach = 0.0;
  for (std::size_t row = 0; row < 3; ++row) {
    const auto add = [&](Index body, const std::array<double, 6>& entries, double sign) {
      if (body < 0) return;
      for (std::size_t k = 0; k < 6; ++k) {
        env.J.push_back(sign * entries[k]);
        env.column.push_back(6 * body + static_cast<Index>(k));
        if (row == 0) approach -= env.J.back() * twist[6 * body + static_cast<Index>(k)];
      }
    };
    add(bodies.body_a[c], rows_a.row[row], -1.0);
    add(bodies.body_b[c], rows_b.row[row], 1.0);
    env.row_offsets.push_back(static_cast<Index>(env.J.size()));
  }
  const Target target =
      target_of(stepping, static_cast<double>(bodies.depth[c]), static_cast<double>(bodies.restitution[c]), approach);
  env.cones.push_back({ConeKind::friction, 3});
  env.target.insert(env.target.end(), {target.velocity, 0.0, 0.0});
  env.R.insert(env.R.end(), 3, stepping.cfm / stepping.dt);
  const auto mu = static_cast<double>(bodies.mu[c]);
  env.mu.insert(env.mu.end(), {0.0, mu, mu});
  to.target_by_depth.push_back(target.by_depth);
  to.bounce.push_back(target.bounce);
}

template <class Real>
void add_body(const BodyBatchView<Real>& bodies, Offset body, const double* twist, JacobianEnvironment<double>& env) {
  const double mass = 1.0 / static_cast<double>(bodies.inv_mass[body]);
  std::array<double, 6> inverse_inertia{};
  for (std::size_t k = 0; k < 6; ++k)
    inverse_inertia[k] = static_cast<double>(bodies.inv_inertia[6 * body + static_cast<Offset>(k)]);
  env.M.insert(env.M.end(), {mass, 0.0, 0.0, 0.0, mass, 0.0, 0.0, 0.0, mass});
  const std::array<double, 9> inertia = inverse(inverse_inertia);
  env.M.insert(env.M.end(), inertia.begin(), inertia.end());
  for (Offset k = 0; k < 6; ++k)
    env.v_free.push_back(
        twist[k] + (bodies.twist_change == nullptr ? 0.0 : static_cast<double>(bodies.twist_change[6 * body + k])));
}

}  // namespace

template <class Real>
ContactRows contact_rows(const Real* normal, const Real* arm) {
  const double n[3] = {static_cast<double>(normal[0]), static_cast<double>(normal[1]), static_cast<double>(normal[2])};
  const double r[3] = {static_cast<double>(arm[0]), static_cast<double>(arm[1]), static_cast<double>(arm[2])};
  double t1[3];
  double t2[3];
  contact_tangents(n, t1, t2);
  const auto row = [&](const double (&d)[3]) -> std::array<double, 6> {
    return {d[0], d[1], d[2], r[1] * d[2] - r[2] * d[1], r[2] * d[0] - r[0] * d[2], r[0] * d[1] - r[1] * d[0]};
  };
  return {{row(n), row(t1), row(t2)}};
}

template <class Real>
BodyJacobians body_jacobians(const BodyBatchView<Real>& bodies, std::span<const Real> twist,
                             std::span<const Real> impulse, const TimeStepping& stepping, Law law) {
  BodyJacobians to{JacobianBatch<double>(law, MassForm::matrix, 3), {impulse.begin(), impulse.end()}, {}, {}};
  const std::vector<double> begin(twist.begin(), twist.end());
  for (Offset e = 0; e < bodies.env_count; ++e) {
    JacobianEnvironment<double> env;
    env.row_offsets = {0};
    const Offset first = bodies.env_body_offsets[e];
    const double* const own = begin.data() + 6 * first;
    for (Offset body = first; body < bodies.env_body_offsets[e + 1]; ++body)
      add_body(bodies, body, begin.data() + 6 * body, env);
    for (Offset c = bodies.env_contact_offsets[e]; c < bodies.env_contact_offsets[e + 1]; ++c)
      add_contact(bodies, c, stepping, own, env, to);
    to.batch.add(env);
  }
  return to;
}

template ContactRows contact_rows(const float*, const float*);
template ContactRows contact_rows(const double*, const double*);
template BodyJacobians body_jacobians(const BodyBatchView<float>&, std::span<const float>, std::span<const float>,
                                      const TimeStepping&, Law);
template BodyJacobians body_jacobians(const BodyBatchView<double>&, std::span<const double>, std::span<const double>,
                                      const TimeStepping&, Law);

}  // namespace stiction
