#pragma once

#include <span>
#include <vector>

#include "scenes/geometry.hpp"
#include "stiction/types.hpp"

namespace stiction::scenes {

/// Nonzero of a Jacobian row.
struct Entry {
  Index dof;
  double value;
};

/// The body that is the world: it does not move.
inline constexpr Index kWorld = -1;

/// Trees of one-degree-of-freedom joints at one instant, in world coordinates. A body is named by the last degree of
/// freedom on its way from the root. A free body is six of them in a line. Every tree is one block of the mass matrix,
/// so trees are added one after another.
class Multibody {
 public:
  enum class Motion { slide, turn };

  struct Dof {
    Index parent;  ///< next degree of freedom towards the root, kWorld at the root
    Motion motion;
    Vec3 axis;        ///< unit vector
    Vec3 point;       ///< a point on the axis [m]; a slide has none
    double velocity;  ///< before the step [m/s, rad/s]
    double force;     ///< actuator [N, N m]
    double armature;  ///< rotor inertia seen at the joint [kg, kg m^2]
  };

  Index add_slide(Index parent, Vec3 axis, double velocity);
  Index add_hinge(Index parent, Vec3 axis, Vec3 point, double velocity, double armature = 0);

  /// Hangs mass onto a body; inertia about `center`, world axes.
  void add_mass(Index body, double mass, Vec3 center, const Mat3& inertia);

  /// Adds six degrees of freedom (velocity of the centre, then spin, both in world axes) carrying one mass. The
  /// returned body is the last of the six.
  Index add_free_body(double mass, Vec3 center, const Mat3& inertia, Vec3 velocity, Vec3 spin);

  void add_force(Index dof, double force) { dofs_[static_cast<std::size_t>(dof)].force += force; }
  /// Adds the generalised force of a force on a point of a body [N].
  void add_force_at(Index body, Vec3 point, Vec3 force);

  /// Appends sign * d(direction . velocity of the point fixed to body)/dv; the world appends nothing.
  void append_velocity(std::vector<Entry>& row, Index body, Vec3 point, Vec3 direction, double sign) const;
  /// Appends sign * d(direction . spin of body)/dv.
  void append_spin(std::vector<Entry>& row, Index body, Vec3 direction, double sign) const;

  [[nodiscard]] std::span<const Dof> dofs() const noexcept { return dofs_; }
  /// First degree of freedom of each block, and the count of all at the end.
  [[nodiscard]] std::vector<Index> block_offsets() const;
  /// Dense mass matrix of degrees of freedom first .. first+size-1, row-major: sum over masses of
  /// m Jv' Jv + Jw' I Jw, plus armature.
  [[nodiscard]] std::vector<double> mass_block(Index first, Index size) const;
  /// Impulse of gravity and actuators over one time step [N s, N m s].  (dof count)
  [[nodiscard]] std::vector<double> step_impulse() const;

 private:
  struct Mass {
    Index body;
    double mass;
    Vec3 center;
    Mat3 inertia;
  };

  [[nodiscard]] Vec3 velocity_column(const Dof& dof, Vec3 point) const;

  std::vector<Dof> dofs_;
  std::vector<Mass> masses_;
};

}  // namespace stiction::scenes
