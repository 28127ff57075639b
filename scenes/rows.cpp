#include "scenes/rows.hpp"

#include <algorithm>

#include "scenes/delassus.hpp"

namespace stiction::scenes {
namespace {

constexpr double kRecoveredPerStep = 0.2;  // of an overlap [-]
constexpr double kRecoveryLimit = 1.0;     // [m/s]
constexpr double kBounceThreshold = 0.1;   // slower impacts do not bounce [m/s]

double position_target(double gap) {
  if (gap >= 0) return -gap / kTimeStep;
  const double speed = -kRecoveredPerStep * gap / kTimeStep;
  return speed < kRecoveryLimit ? speed : kRecoveryLimit;
}

}  // namespace

void RowWriter::add_row(std::vector<Entry>& entries, double target, double mu, double bound) {
  std::sort(entries.begin(), entries.end(), [](const Entry& a, const Entry& b) { return a.dof < b.dof; });
  for (const Entry& entry : entries) {
    if (entry.value == 0) continue;
    env_.J.col.push_back(entry.dof);
    env_.J.val.push_back(entry.value);
  }
  env_.J.ptr.push_back(static_cast<Index>(env_.J.col.size()));
  env_.row_target.push_back(target);
  env_.system.mu.push_back(mu);
  env_.system.lo.push_back(bound == 0 ? 0.0 : -bound);
  env_.system.hi.push_back(bound);
  ++env_.system.cones.back().row_count;
}

std::vector<Entry> RowWriter::relative_velocity(const Contact& contact, Vec3 direction) const {
  std::vector<Entry> row;
  bodies_.append_velocity(row, contact.body_b, contact.point, direction, 1);
  bodies_.append_velocity(row, contact.body_a, contact.point, direction, -1);
  return row;
}

double RowWriter::normal_target(const Contact& contact, const std::vector<Entry>& normal_row) const {
  double speed = 0;
  for (const Entry& entry : normal_row) {
    speed += entry.value * bodies_.dofs()[static_cast<std::size_t>(entry.dof)].velocity;
  }
  const double position = position_target(contact.gap);
  const double bounce = -contact.restitution * speed;
  return speed < -kBounceThreshold && bounce > position ? bounce : position;
}

void RowWriter::add_contact(const Contact& contact, std::span<const double> mu, Index group) {
  begin_cone(ConeKind::friction, group);
  std::vector<Entry> normal_row = relative_velocity(contact, contact.normal);
  const double target = normal_target(contact, normal_row);
  add_row(normal_row, target);
  const auto tangents = tangents_of(contact.normal);
  for (std::size_t axis = 0; axis < mu.size(); ++axis) {
    std::vector<Entry> row;
    if (axis < tangents.size()) {
      row = relative_velocity(contact, tangents[axis]);
    } else {
      bodies_.append_spin(row, contact.body_b, contact.normal, 1);
      bodies_.append_spin(row, contact.body_a, contact.normal, -1);
    }
    add_row(row, 0, mu[axis]);
  }
}

void RowWriter::add_contact(const Contact& contact, double mu, Index group) {
  const double both[] = {mu, mu};
  add_contact(contact, both, group);
}

void RowWriter::add_frictionless_contact(const Contact& contact) {
  begin_cone(ConeKind::unilateral);
  std::vector<Entry> row = relative_velocity(contact, contact.normal);
  const double target = normal_target(contact, row);
  add_row(row, target);
}

void RowWriter::add_ball_joint(Index body_a, Index body_b, Vec3 point) {
  const Contact joint{body_a, body_b, point, {}, 0, 0};
  for (const Vec3 axis : {Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}}) {
    begin_cone(ConeKind::free);
    std::vector<Entry> row = relative_velocity(joint, axis);
    add_row(row, 0);
  }
}

void RowWriter::add_limit(Index dof, double sign, double gap) {
  begin_cone(ConeKind::unilateral);
  std::vector<Entry> row{{dof, sign}};
  add_row(row, position_target(gap));
}

void RowWriter::add_near_limits(Index hinge, double angle, double lowest, double highest) {
  constexpr double kMargin = 0.1;  // [rad]
  const double above = angle - lowest, below = highest - angle;
  if (above < kMargin) add_limit(hinge, 1, above);
  if (below < kMargin) add_limit(hinge, -1, below);
}

void RowWriter::add_joint_friction(Index dof, double force) {
  begin_cone(ConeKind::box);
  std::vector<Entry> row{{dof, 1.0}};
  add_row(row, 0, 0, force * kTimeStep);
}

void RowWriter::set_compliance(double ratio) {
  Environment<double>& system = env_.system;
  const auto diagonal = [&](std::size_t row) {
    const auto begin = system.column.begin() + system.row_offsets[row];
    const auto end = system.column.begin() + system.row_offsets[row + 1];
    const auto found = std::lower_bound(begin, end, static_cast<Index>(row));
    return system.A[static_cast<std::size_t>(found - system.column.begin())];
  };
  std::size_t row = 0;
  for (const auto& cone : system.cones) {
    const std::size_t first = row;
    for (; row < first + static_cast<std::size_t>(cone.row_count); ++row) {
      if (row == first) {
        system.R[row] = ratio * diagonal(row);
      } else {
        const double scale = system.mu[first + 1] / system.mu[row];
        system.R[row] = system.R[first] * scale * scale;
      }
    }
  }
}

SceneEnv RowWriter::finish(double compliance_ratio) && {
  const BlockMass mass(bodies_);
  const std::size_t row_count = env_.row_target.size();
  env_.dof_count = mass.dof_count();
  env_.M = mass.matrix();
  env_.v_free = mass.solve(bodies_.step_impulse());
  for (std::size_t k = 0; k < env_.v_free.size(); ++k) env_.v_free[k] += bodies_.dofs()[k].velocity;

  mass.assemble(env_.J, env_.system);
  env_.system.b.resize(row_count);
  for (std::size_t i = 0; i < row_count; ++i) {
    double sum = 0;
    for (auto k = static_cast<std::size_t>(env_.J.ptr[i]); k < static_cast<std::size_t>(env_.J.ptr[i + 1]); ++k) {
      sum += env_.J.val[k] * env_.v_free[static_cast<std::size_t>(env_.J.col[k])];
    }
    env_.system.b[i] = sum - env_.row_target[i];
  }
  env_.system.R.assign(row_count, 0.0);
  if (compliance_ratio > 0) set_compliance(compliance_ratio);
  return std::move(env_);
}

}  // namespace stiction::scenes
