#pragma once

/// \file
/// Derivatives of one step of a world (docs/howto/stepping.md).

#include <memory>
#include <span>
#include <vector>

#include "stiction/derivative.hpp"
#include "stiction/world.hpp"

namespace stiction {

/// Derivatives of a loss by the beginning of a step; bodies and contacts of all environments as in the World.
template <class Real>
struct WorldGradient {
  std::vector<Real> position;    ///< by centres of mass, geometry but depths frozen     (3 * body_count * env_count)
  std::vector<Real> twist;       ///< by velocities and spins                            (6 * body_count * env_count)
  std::vector<Real> wrench;      ///< by forces and torques                              (6 * body_count * env_count)
  std::vector<Real> friction;    ///< by the friction of each shape                      (shapes * env_count)
  std::vector<Real> contact_mu;  ///< by the friction of each contact                    (contacts)
  std::vector<Real> depth;       ///< by the depth of each contact [1/m]                 (contacts)
  std::vector<GradientStatus> status;  ///< a record per environment                       (env_count)
};

/// One step of a world, kept in host memory so that it can be differentiated: a rollout keeps one for each of its
/// steps. It differentiates the solution of the step's contact problem (docs/math/derivative.md), restitution and
/// stabilisation included, and its use in the step.
///
/// Contacts are those that the step had. Only the depth of their geometry follows positions. Normals, arms and
/// inertias are frozen, and rotations are not differentiated. A derivative by `position` is hence exact only where
/// nothing else counts, as of a ball on a plane without friction. All others have no part in geometry, and are exact.
///
/// Give contacts compliance (TimeStepping::cfm > 0), and solve to a tolerance. A body on four corners has reactions
/// that are not determined otherwise, and is flagged kGradientSingular.
template <class Real>
class WorldStep {
 public:
  /// Makes one step of `world` and keeps the input of its derivative.
  /// \throws Error(invalid_argument) for options out of range, or a world whose contacts have a capacity
  /// (solver.max_contacts_per_env), whose dropped contacts are unknown. Also for boxed friction (solver.box_friction).
  explicit WorldStep(World<Real>& world, const DerivativeOptions& options = {});
  ~WorldStep();
  WorldStep(WorldStep&&) noexcept;
  WorldStep& operator=(WorldStep&&) noexcept;

  /// Pulls derivatives of a loss by the twists and the positions after the step back to its beginning. Lengths are 6
  /// and 3 * body_count * env_count; of no positions: zeros. An environment that is refused gets zeros and a flag.
  /// \throws Error(invalid_argument) for a wrong length.
  [[nodiscard]] WorldGradient<Real> pull(std::span<const Real> twist, std::span<const Real> position = {}) const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace stiction
