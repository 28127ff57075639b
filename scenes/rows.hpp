#pragma once

#include <span>
#include <vector>

#include "scenes/multibody.hpp"
#include "scenes/scenes.hpp"

namespace stiction::scenes {

/// A point where two bodies touch.
struct Contact {
  Index body_a = kWorld, body_b = kWorld;
  Vec3 point{};            ///< [m]
  Vec3 normal{};           ///< unit vector from a to b
  double gap = 0;          ///< distance, negative when they overlap [m]
  double restitution = 0;  ///< Newton's [-]
};

/// Writes constraint rows of a multibody, then the whole system. Target velocities (scenes/README.md, 2): a contact may
/// close its gap within the step. It recovers a fifth of an overlap per step, at most 1 m/s.
class RowWriter {
 public:
  explicit RowWriter(const Multibody& bodies) : bodies_(bodies) {}

  /// A manifold id for contacts of one pair of bodies.
  [[nodiscard]] Index new_group() noexcept { return group_count_++; }

  /// Friction cone of 1 + mu.size() rows: normal, first tangent, second tangent and, with three mu, torsion.
  void add_contact(const Contact& contact, std::span<const double> mu, Index group);
  void add_contact(const Contact& contact, double mu, Index group);
  /// Unilateral row: the contact's normal alone.
  void add_frictionless_contact(const Contact& contact);
  /// Three free rows: the two bodies keep a point in common.
  void add_ball_joint(Index body_a, Index body_b, Vec3 point);
  /// Unilateral row: `sign` * velocity of the joint >= 0 once `gap` is used up [m, rad].
  void add_limit(Index dof, double sign, double gap);
  /// Rows of the limits that a hinge is near.
  void add_near_limits(Index hinge, double angle, double lowest, double highest);
  /// Box row: dry friction of a joint [N, N m].
  void add_joint_friction(Index dof, double force);

  /// The environment. R = 0 for a ratio of 0. Otherwise R of a normal, limit or joint friction row is ratio * A_ii. R
  /// of a friction row j is R_normal * (mu_1 / mu_j)^2, as MuJoCo has it.
  [[nodiscard]] SceneEnv finish(double compliance_ratio = 0) &&;

  [[nodiscard]] std::size_t cone_count() const noexcept { return env_.system.cones.size(); }

 private:
  void begin_cone(ConeKind kind, Index group = -1) { env_.system.cones.push_back({kind, 0, group}); }
  /// Adds a row to the last cone.
  void add_row(std::vector<Entry>& entries, double target, double mu = 0, double bound = 0);
  [[nodiscard]] std::vector<Entry> relative_velocity(const Contact& contact, Vec3 direction) const;
  [[nodiscard]] double normal_target(const Contact& contact, const std::vector<Entry>& normal_row) const;
  void set_compliance(double ratio);

  const Multibody& bodies_;
  SceneEnv env_;
  Index group_count_ = 0;
};

}  // namespace stiction::scenes
