#pragma once

/// \file
/// Worlds of rigid bodies, stepped without an engine (docs/howto/stepping.md).

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "stiction/bodies.hpp"

namespace stiction {

/// Shapes that touch.
enum class ShapeKind : std::uint8_t {
  sphere = 0,   ///< size[0] radius
  capsule = 1,  ///< size[0] radius, size[1] half length of the segment along the shape's z axis
  box = 2,      ///< size: half extents
  plane = 3,    ///< half space below the shape's x-y plane; its normal is the shape's z axis; of the world alone
};

/// The largest friction that a shape may have. Steps see squares of it, which single precision must hold.
inline constexpr double kLargestShapeFriction = 1e12;

/// A shape fixed to a body or to the world. Lengths in m.
struct WorldShape {
  Index body = -1;                                ///< -1: the world
  ShapeKind kind = ShapeKind::sphere;             ///< kind
  std::array<double, 3> size{};                   ///< by the kind, > 0 [m]
  std::array<double, 3> position{};               ///< of its centre, in the body's axes
  std::array<double, 4> orientation{1, 0, 0, 0};  ///< unit quaternion (w, x, y, z), from the shape's axes to the body's
  double mu = 0.5;           ///< friction, >= 0 and at most kLargestShapeFriction; a pair has the square root of the
                             ///< product of its two [-]
  double restitution = 0.0;  ///< Newton's, in [0, 1]; a pair has the larger of its two [-]
};

/// A rigid body, and where every environment begins unless reset() changes it. Its axes are its principal axes.
struct WorldBody {
  double mass = 1;                                ///< > 0 [kg]
  std::array<double, 3> inertia{1, 1, 1};         ///< about the centre of mass, along its axes, > 0 [kg m^2]
  std::array<double, 3> position{};               ///< of the centre of mass [m]
  std::array<double, 4> orientation{1, 0, 0, 0};  ///< unit quaternion (w, x, y, z), from the body's axes to the world's
  std::array<double, 6> twist{};                  ///< velocity [m/s], spin [rad/s], world axes
};

/// Description shared by all environments of a world.
struct WorldDescription {
  std::vector<WorldBody> bodies;               ///< bodies; shapes name them by their place here
  std::vector<WorldShape> shapes;              ///< shapes of all bodies and of the world
  std::array<double, 3> gravity{0, 0, -9.81};  ///< [m/s^2]
};

/// Mass and principal moments of a body of uniform density (kg/m^3) that has this shape, its centre and axes.
/// \throws Error(invalid_argument) for a plane, which has no mass.
WorldBody solid_body(const WorldShape& shape, double density);

/// Sweeps until a step is solved: to 1e-4, in double precision to 1e-7. A stack of 0.1 kg and 10 kg in turn needs one
/// or two thousand.
template <class Real = float>
BodySolverOptions until_solved() {
  constexpr bool wide = sizeof(Real) == sizeof(double);
  BodySolverOptions options;
  options.iterations = wide ? 4000 : 2000;
  options.tolerance = wide ? 1e-7 : 1e-4;
  return options;
}

/// A restitution_threshold for a world of any size and unit: the speed that gravity gives in five steps, at most
/// 0.1 [m/s]. Contacts at rest approach by the speed of one step.
double slowest_bounce(const std::array<double, 3>& gravity, double dt);

/// Options of a World.
struct WorldOptions {
  TimeStepping stepping;  ///< the step, and how contacts enter it
  /// substeps must be 1: a world detects contacts in every step. until_solved<double>() is for a World<double>.
  BodySolverOptions solver = until_solved();
  double margin = 0.01;      ///< gap up to which a pair is a contact even if it does not close, >= 0 [m]
  double warm_start = 0.95;  ///< share of a contact's last impulse its next one starts from, in [0, 1]; 0: none [-]
};

/// Bodies of all environments, environment after environment.
template <class Real>
struct WorldState {
  std::span<const Real> position;     ///< of the centres of mass [m]             (3 * body_count * env_count)
  std::span<const Real> orientation;  ///< unit quaternions (w, x, y, z)          (4 * body_count * env_count)
  std::span<const Real> twist;        ///< velocity [m/s], spin [rad/s]           (6 * body_count * env_count)
};

/// A world between two steps, in host memory: all that its next step depends on beside description and options.
template <class Real>
struct WorldCheckpoint {
  std::vector<Real> position, orientation, twist;  ///< shapes and units of WorldState
  std::vector<Real> wrench;                        ///< shape and unit of World::wrench()
  std::vector<Offset> contact_offsets;             ///< where each environment's contacts begin      (env_count + 1)
  std::vector<std::uint64_t> contact_id;           ///< of the last step, ascending in an environment     (contacts)
  std::vector<Real> impulse;                       ///< final impulses [N s]                          (3 * contacts)
};

/// Solves the contacts of one step. `batch` and `solution` are as BodySolver::solve has them, in the memory of the
/// world's device. Every array of `solution` but w is there, and is to be written. `guess` is a first guess
/// (3 * contacts), or null.
template <class Real>
using StepSolver =
    std::function<void(const BodyBatchView<Real>& batch, const BodySolutionView<Real>& solution, const Real* guess)>;

/// Quantities of one environment that are conserved, or should be; summed in double.
struct WorldMotion {
  double kinetic = 0;                      ///< [J]
  double potential = 0;                    ///< in gravity, zero at the origin [J]
  double momentum[3] = {0, 0, 0};          ///< [N s]
  double angular_momentum[3] = {0, 0, 0};  ///< about the origin [N m s]
};

/// Time of all steps so far, by part [s].
struct WorldSeconds {
  double detect = 0;     ///< contacts, their order, first guesses
  double plan = 0;       ///< colours and order of the solve
  double solve = 0;      ///< reactions and velocities
  double integrate = 0;  ///< positions
};

/// Many environments of the same rigid bodies, stepped together (docs/howto/stepping.md). Contacts are of spheres,
/// capsules, boxes and planes. A step makes one body solve with first guesses by contact, and semi-implicit Euler. An
/// environment's bits depend on description, options and its own state alone: not on its neighbours, the threads, or
/// the device.
///
/// A world is in the memory of its device, and data that is read is copied from there. One thread at a time may use
/// it. An environment may have any number of bodies and shapes. Beyond 128 shapes a tree of boxes finds those near
/// each other. Contacts, their order and their ids are those of testing all pairs.
template <class Real>
class World {
 public:
  /// `env_count` copies of the described bodies. \throws Error(invalid_argument) for a description or option out of
  /// range; as BodySolver's constructor.
  World(Device device, WorldDescription description, Offset env_count, const WorldOptions& options = {});
  ~World();
  World(World&&) noexcept;
  World& operator=(World&&) noexcept;

  /// One step of options.stepping.dt. An environment whose state or wrench is not finite ends as `invalid_input` and
  /// stays where it is; no other environment changes.
  void step();
  /// One step whose contacts `solve` answers in place of the world's own solver, as over several processes
  /// (docs/howto/ranks.md). Its exceptions are passed on: bodies are then where they were, and impulses to start from
  /// are forgotten. \throws Error(invalid_argument) for an empty function.
  void step(const StepSolver<Real>& solve);

  /// Positions, orientations and twists of all environments; valid until the next step or reset.
  [[nodiscard]] WorldState<Real> state() const;
  /// Force [N] and torque about the centre of mass [N m] on every body, world axes, in every step until changed. Zero
  /// at first (6 * body_count * env_count).
  [[nodiscard]] std::span<Real> wrench();
  /// Puts environment e into the state given for it wherever mask[e] is not zero, and forgets its contacts. Quaternions
  /// are normalised. \throws Error(invalid_argument) if a length is wrong or a quaternion is zero or not finite.
  void reset(std::span<const std::uint8_t> mask, const WorldState<Real>& state);
  /// Puts masked environments into the description's state.
  void reset(std::span<const std::uint8_t> mask);

  /// A copy of the world between two steps.
  [[nodiscard]] WorldCheckpoint<Real> checkpoint() const;
  /// Goes on from a checkpoint of a world with the same description, options and env_count, on whatever device. The
  /// next steps have the bits that its next steps had. Until then status() is all zero, and contacts() has nothing but
  /// offsets, ids and impulses. A call that throws changes nothing. \throws Error(invalid_argument) if a length is
  /// wrong. Also if offsets do not begin at 0 or decrease, or the ids of an environment do not ascend.
  void resume(const WorldCheckpoint<Real>& from);

  /// Returns the outcome of the last step's solve: a record per environment, all zero before the first step.
  [[nodiscard]] std::span<const EnvStatus> status() const;
  /// Returns the offsets of each environment's contacts in the last step (env_count + 1).
  [[nodiscard]] std::span<const Offset> contact_offsets() const;
  /// The last step's contacts and their final impulses; valid until the next step.
  [[nodiscard]] BodyBatchView<Real> contacts() const;
  [[nodiscard]] std::span<const Real> impulses() const;  ///< normal, tangential, tangential [N s]  (3 * contacts)

  /// Energy and momentum of each environment (env_count).
  [[nodiscard]] std::vector<WorldMotion> motion() const;
  /// Hash of all positions, orientations and twists.
  [[nodiscard]] std::uint64_t hash() const;
  /// Returns the time of all steps, by part.
  [[nodiscard]] const WorldSeconds& seconds() const;
  /// Environments.
  [[nodiscard]] Offset env_count() const;
  /// Bodies of one environment.
  [[nodiscard]] Index body_count() const;
  /// Description that the world was made from.
  [[nodiscard]] const WorldDescription& description() const;
  /// Options that the world was made with.
  [[nodiscard]] const WorldOptions& options() const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace stiction
