#include "scenes/multibody.hpp"

#include <algorithm>

#include "scenes/scenes.hpp"

namespace stiction::scenes {

Index Multibody::add_slide(Index parent, Vec3 axis, double velocity) {
  dofs_.push_back({parent, Motion::slide, axis, {}, velocity, 0, 0});
  return static_cast<Index>(dofs_.size()) - 1;
}

Index Multibody::add_hinge(Index parent, Vec3 axis, Vec3 point, double velocity, double armature) {
  dofs_.push_back({parent, Motion::turn, axis, point, velocity, 0, armature});
  return static_cast<Index>(dofs_.size()) - 1;
}

void Multibody::add_mass(Index body, double mass, Vec3 center, const Mat3& inertia) {
  masses_.push_back({body, mass, center, inertia});
}

Index Multibody::add_free_body(double mass, Vec3 center, const Mat3& inertia, Vec3 velocity, Vec3 spin) {
  Index body = add_slide(kWorld, {1, 0, 0}, velocity.x);
  body = add_slide(body, {0, 1, 0}, velocity.y);
  body = add_slide(body, {0, 0, 1}, velocity.z);
  body = add_hinge(body, {1, 0, 0}, center, spin.x);
  body = add_hinge(body, {0, 1, 0}, center, spin.y);
  body = add_hinge(body, {0, 0, 1}, center, spin.z);
  add_mass(body, mass, center, inertia);
  return body;
}

void Multibody::add_force_at(Index body, Vec3 point, Vec3 force) {
  for (Index k = body; k != kWorld; k = dofs_[static_cast<std::size_t>(k)].parent) {
    const Dof& dof = dofs_[static_cast<std::size_t>(k)];
    add_force(k, dot(velocity_column(dof, point), force));
  }
}

Vec3 Multibody::velocity_column(const Dof& dof, Vec3 point) const {
  return dof.motion == Motion::slide ? dof.axis : cross(dof.axis, point - dof.point);
}

void Multibody::append_velocity(std::vector<Entry>& row, Index body, Vec3 point, Vec3 direction, double sign) const {
  for (Index k = body; k != kWorld; k = dofs_[static_cast<std::size_t>(k)].parent) {
    row.push_back({k, sign * dot(velocity_column(dofs_[static_cast<std::size_t>(k)], point), direction)});
  }
}

void Multibody::append_spin(std::vector<Entry>& row, Index body, Vec3 direction, double sign) const {
  for (Index k = body; k != kWorld; k = dofs_[static_cast<std::size_t>(k)].parent) {
    const Dof& dof = dofs_[static_cast<std::size_t>(k)];
    if (dof.motion == Motion::turn) row.push_back({k, sign * dot(dof.axis, direction)});
  }
}

std::vector<Index> Multibody::block_offsets() const {
  std::vector<Index> offsets;
  for (std::size_t k = 0; k < dofs_.size(); ++k) {
    if (dofs_[k].parent == kWorld) offsets.push_back(static_cast<Index>(k));
  }
  offsets.push_back(static_cast<Index>(dofs_.size()));
  return offsets;
}

std::vector<double> Multibody::mass_block(Index first, Index size) const {
  const auto n = static_cast<std::size_t>(size);
  std::vector<double> block(n * n, 0.0);
  // Masses come in the order of their trees, so those of one block are neighbours.
  auto mass = std::partition_point(masses_.begin(), masses_.end(), [&](const Mass& m) { return m.body < first; });
  for (; mass != masses_.end() && mass->body < first + size; ++mass) {
    for (Index i = mass->body; i != kWorld; i = dofs_[static_cast<std::size_t>(i)].parent) {
      const Dof& di = dofs_[static_cast<std::size_t>(i)];
      const Vec3 momentum = mass->mass * velocity_column(di, mass->center);
      const Vec3 angular = di.motion == Motion::turn ? mass->inertia * di.axis : Vec3{};
      for (Index j = i; j != kWorld; j = dofs_[static_cast<std::size_t>(j)].parent) {
        const Dof& dj = dofs_[static_cast<std::size_t>(j)];
        double value = dot(momentum, velocity_column(dj, mass->center));
        if (dj.motion == Motion::turn) value += dot(angular, dj.axis);
        block[static_cast<std::size_t>(i - first) * n + static_cast<std::size_t>(j - first)] += value;
      }
    }
  }
  for (std::size_t i = 0; i < n; ++i) {
    block[i * n + i] += dofs_[static_cast<std::size_t>(first) + i].armature;
    for (std::size_t j = 0; j < i; ++j) block[j * n + i] = block[i * n + j];
  }
  return block;
}

std::vector<double> Multibody::step_impulse() const {
  std::vector<double> impulse(dofs_.size());
  for (std::size_t k = 0; k < dofs_.size(); ++k) impulse[k] = kTimeStep * dofs_[k].force;
  for (const Mass& mass : masses_) {
    for (Index k = mass.body; k != kWorld; k = dofs_[static_cast<std::size_t>(k)].parent) {
      const Dof& dof = dofs_[static_cast<std::size_t>(k)];
      impulse[static_cast<std::size_t>(k)] -= kTimeStep * kGravity * mass.mass * velocity_column(dof, mass.center).z;
    }
  }
  return impulse;
}

}  // namespace stiction::scenes
