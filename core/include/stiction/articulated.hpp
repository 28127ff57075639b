#pragma once

/// \file
/// Robots of one model, stepped together without an engine (docs/howto/robots_in_lanes.md).

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "stiction/solver.hpp"

namespace stiction {

/// Kinds of joints; the values are MuJoCo's.
enum class JointKind : std::uint8_t {
  free = 0,  ///< 7 coordinates: position, unit quaternion (w, x, y, z); 6 velocities: linear in world axes, spin in the
             ///< body's
  ball = 1,  ///< 4 coordinates: a unit quaternion; 3 velocities: spin in the body's axes
  slide = 2,  ///< 1 coordinate [m]
  hinge = 3,  ///< 1 coordinate [rad]
};

/// Shapes that touch; the values are MuJoCo's.
enum class GeomKind : std::uint8_t {
  plane = 0,         ///< of bodies that never move alone; its normal is its z axis
  height_field = 1,  ///< likewise; against spheres, capsules and boxes
  sphere = 2,        ///< size[0] radius
  capsule = 3,       ///< size[0] radius, size[1] half length along its z axis
  cylinder = 5,      ///< the same; not on height fields
  box = 6,           ///< size: half extents
  mesh = 7,          ///< a convex hull; not on height fields
};

/// How far a row gives: MuJoCo's solref and solimp (MuJoCo documentation, "Solver parameters"). The exponent in
/// solimp[4] is an integer from 1 to 8.
struct ArticulatedGive {
  std::array<double, 2> solref{0.02, 1};                   ///< time constant [s] and damping ratio, or minus both rates
  std::array<double, 5> solimp{0.9, 0.95, 0.001, 0.5, 2};  ///< impedances, width, midpoint, power
};

/// A body in the frame of its parent. Body 0 is the world; a parent comes before its children, depth first.
struct ArticulatedBody {
  Index parent = 0;                                ///< of body 0 itself: 0
  Index joints = 0;                                ///< how many of the description's joints, in order, move it
  std::array<double, 3> position{};                ///< [m]
  std::array<double, 4> orientation{1, 0, 0, 0};   ///< unit quaternion (w, x, y, z)
  double mass = 0;                                 ///< [kg]
  std::array<double, 3> centre{};                  ///< of mass, in the body's frame [m]
  std::array<double, 4> inertia_axes{1, 0, 0, 0};  ///< unit quaternion, from its principal axes to its frame
  std::array<double, 3> inertia{};                 ///< principal moments [kg m^2]
  std::array<double, 2> inverse_weight{};          ///< of its translation and rotation, MuJoCo's body_invweight0
  double gravity_compensation = 0;                 ///< share of its weight that a passive force holds [-]
};

/// A joint in the frame of its body.
struct ArticulatedJoint {
  JointKind kind = JointKind::hinge;    ///< kind
  std::array<double, 3> position{};     ///< [m]
  std::array<double, 3> axis{0, 0, 1};  ///< of unit length
  double reference = 0;                 ///< coordinate in the frame that the body is described in
  double stiffness = 0;                 ///< of a hinge or slide [N m/rad, N/m]
  double rest = 0;                      ///< coordinate without spring force
  bool is_limited = false;              ///< of a hinge or slide
  std::array<double, 2> range{};        ///< coordinates between its limits
  double margin = 0;                    ///< distance from a limit at which its row begins
  ArticulatedGive limit;                ///< of its limits
  bool is_force_limited = false;        ///< its actuators' forces together are clipped
  std::array<double, 2> force_range{};  ///< to this [N m, N]
};

/// One velocity of a joint.
struct ArticulatedDof {
  double armature = 0;        ///< added to M's diagonal
  double damping = 0;         ///< force per velocity
  double friction_loss = 0;   ///< largest force of dry friction, 0: no row
  ArticulatedGive loss;       ///< of that row
  double inverse_weight = 0;  ///< MuJoCo's dof_invweight0
};

/// An actuator of a hinge or slide: its force is gain times control, plus bias.
struct ArticulatedActuator {
  Index joint = 0;                      ///< joint
  double gear = 1;                      ///< length over coordinate, and force over actuator force
  std::array<double, 3> gain{1, 0, 0};  ///< constant, per length, per velocity
  std::array<double, 3> bias{};         ///< the same
  std::array<double, 2> control;        ///< controls are clipped to this; infinite: they are not
  std::array<double, 2> force;          ///< forces are clipped to this; infinite: they are not
};

/// A hinge or slide whose coordinate, less its reference, is a polynomial of another's, or a constant.
struct ArticulatedEquality {
  Index joint_a = 0;                                ///< the joint
  Index joint_b = -1;                               ///< that it follows; -1: none
  std::array<double, 5> polynomial{0, 1, 0, 0, 0};  ///< coefficients by ascending power
  ArticulatedGive give;                             ///< of its row
};

/// Ground over a grid, the same in all environments. Cells are cut from the corner of least x and y to the opposite
/// one. Below their two triangles it is solid.
struct ArticulatedHeightField {
  Index rows = 0, columns = 0;   ///< of the grid, along y and x, at least 2
  std::array<double, 2> half{};  ///< half its widths along x and y [m], > 0
  double base = 0;               ///< how far it goes down below its frame [m], > 0
  std::vector<double> heights;   ///< above its frame, beginning where x and y are least [m]   (rows, columns)
};

/// The convex hull of a mesh, the same in all environments. A face is a flat polygon.
struct ArticulatedHull {
  std::vector<std::array<double, 3>> vertices;  ///< in the geom's frame [m]
  std::vector<Index> face_begin;                ///< first of each face's corners, then how many all have  (faces + 1)
  std::vector<Index> corners;                   ///< vertices around each face
};

/// A shape in the frame of its body.
struct ArticulatedGeom {
  Index body = 0;                                 ///< body
  GeomKind kind = GeomKind::sphere;               ///< kind
  std::array<double, 3> size{};                   ///< as the kind says [m]
  std::array<double, 3> position{};               ///< of its centre [m]
  std::array<double, 4> orientation{1, 0, 0, 0};  ///< unit quaternion (w, x, y, z)
  Index field = -1;                               ///< of a height field: its number
  Index hull = -1;                                ///< of a mesh: its number
};

/// Two geoms that may touch, kinds in ascending order.
struct ArticulatedPair {
  Index geom_a = 0, geom_b = 0;                             ///< the normal points from the first to the second
  Index dim = 3;                                            ///< 1, 3, 4 or 6 directions in which the contact pushes
  std::array<double, 5> friction{1, 1, 0.005, 1e-4, 1e-4};  ///< two sliding, spinning, two rolling
  double margin = 0;                        ///< distance below which the contact has rows, and from which they count
  double reach = 0;                         ///< points up to here are chosen from: of a box on the ground four corners
  ArticulatedGive give;                     ///< of its rows
  std::array<double, 2> friction_solref{};  ///< of an elliptic cone's tangential rows; zeros: as the normal's
};

/// A joint's part in a fixed tendon, whose length is a weighted sum of coordinates of hinges and slides. Tendons pull
/// at nothing here: they are observed.
struct ArticulatedTendonTerm {
  Index tendon = 0;        ///< tendon
  Index joint = 0;         ///< joint
  double coefficient = 1;  ///< of its coordinate
};

/// The model that all environments of a batch have.
struct ArticulatedDescription {
  double timestep = 0.002;                          ///< [s]
  std::array<double, 3> gravity{0, 0, -9.81};       ///< [m/s^2]
  bool is_elliptic = false;                         ///< cones of contacts; else pyramids
  double impratio = 1;                              ///< of friction to normal impedance
  bool is_rk4 = false;                              ///< Runge and Kutta's method of order 4; else semi-implicit Euler
  bool damps_implicitly = true;                     ///< Euler takes damping at the end of the step
  bool is_implicit_fast = false;                    ///< so does it with velocity terms of actuators, and gyroscopic
                                                    ///< moments of free bodies that carry no joint (`implicitfast`)
  bool keeps_references = true;                     ///< time constants are at least two steps (MuJoCo's refsafe)
  std::vector<ArticulatedBody> bodies;              ///< body 0 first
  std::vector<ArticulatedJoint> joints;             ///< in order of their bodies
  std::vector<ArticulatedDof> dofs;                 ///< in order of their joints
  std::vector<ArticulatedActuator> actuators;       ///< in order of controls
  std::vector<ArticulatedEquality> equalities;      ///< that always hold
  std::vector<ArticulatedHeightField> fields;       ///< that geoms name
  std::vector<ArticulatedHull> hulls;               ///< likewise
  std::vector<ArticulatedGeom> geoms;               ///< that pairs name
  std::vector<ArticulatedPair> pairs;               ///< that may touch
  Index tendons = 0;                                ///< how many there are
  std::vector<ArticulatedTendonTerm> tendon_terms;  ///< in the order of sums
};

/// Constants that environments may have of their own, with MuJoCo's names and layouts. Gains and biases are finite,
/// friction of pairs is above 0, and all else at least 0.
enum class VariedArray : std::uint8_t {
  body_mass = 0,          ///< masses [kg]                                                  (env_count, bodies)
  body_inertia = 1,       ///< principal moments, about the description's axes [kg m^2]     (env_count, bodies, 3)
  pair_friction = 2,      ///< two sliding, spinning, two rolling                           (env_count, pairs, 5)
  actuator_gain = 3,      ///< constant, per length, per velocity                           (env_count, actuators, 3)
  actuator_bias = 4,      ///< as gains                                                     (env_count, actuators, 3)
  dof_damping = 5,        ///< force per velocity                                           (env_count, dof_count)
  dof_armature = 6,       ///< added to M's diagonal                                        (env_count, dof_count)
  dof_friction_loss = 7,  ///< largest force of dry friction, 0: no row                     (env_count, dof_count)
};

/// Accuracy of contacts, threads, and what is kept beside the state.
struct ArticulatedOptions {
  double tolerance = 1e-6;               ///< on the relative residual, > 0; in single precision at least 1e-5 [-]
  Index max_iterations = 100;            ///< Newton steps of a solve, > 0
  int threads = 0;                       ///< of the CPU; 0: all cores
  bool observes_bodies = false;          ///< keeps the arrays of ArticulatedBatch::observed
  std::vector<VariedArray> varies = {};  ///< constants of which each environment has its own
};

/// Arrays of the last evaluation of a step, with MuJoCo's names and layouts. With Runge and Kutta's method that is the
/// fourth; with Euler's it is the state before the step. Sixes have the angular part first, about the centre of mass of
/// the body's whole tree. The world has zeros.
enum class ObservedArray : std::uint8_t {
  xpos = 0,           ///< places of bodies [m]                                            (env_count, bodies, 3)
  xipos = 1,          ///< their centres of mass [m]                                       (env_count, bodies, 3)
  cinert = 2,         ///< xx, yy, zz, xy, xz, yz, mass times offset, mass                 (env_count, bodies, 10)
  cvel = 3,           ///< velocities [rad/s, m/s]                                         (env_count, bodies, 6)
  qfrc_actuator = 4,  ///< forces of actuators on degrees of freedom                       (env_count, dof_count)
  cfrc_ext = 5,       ///< moments and forces of contacts on bodies [N m, N]               (env_count, bodies, 6)
  ten_length = 6,     ///< lengths of tendons                                              (env_count, tendons)
  ten_velocity = 7,   ///< and their rates                                                 (env_count, tendons)
};

/// The model as it is computed at the present states: what tests compare. Rows are in their order of the solve.
struct ArticulatedProbe {
  std::vector<double> M;  ///< lower triangles, row by row              (envs, dofs, dofs)
  std::vector<double> bias, passive, actuator, qacc_smooth, qacc;  ///< by degree of freedom     (envs, dofs)
  std::vector<std::int32_t> rows, contacts;  ///< that each environment has                             (envs)
  std::vector<double> J;                     ///< Jacobian                            (envs, most_rows, dofs)
  std::vector<double> aref, R;               ///< of rows                                  (envs, most_rows)
  std::vector<double> contact;               ///< distance, point, normal               (envs, most_contacts, 7)
  std::vector<std::int32_t> pair;            ///< of each contact                          (envs, most_contacts)
  Index most_rows = 0, most_contacts = 0;    ///< room of an environment
};

/// How many arrays ObservedArray names.
inline constexpr std::size_t kObservedArrays = 8;
/// How many arrays VariedArray names.
inline constexpr std::size_t kVariedArrays = 8;

/// Arrays of a batch where steps read and write them: in host memory on the CPU, otherwise in the device's. Null: there
/// is none. Shapes are those of ArticulatedBatch.
template <class Real>
struct ArticulatedView {
  Real* qpos;                                   ///< coordinates
  Real* qvel;                                   ///< velocities
  Real* ctrl;                                   ///< controls
  Real* qfrc_applied;                           ///< further forces
  Real* qacc;                                   ///< last accelerations
  double* time;                                 ///< time [s]
  EnvStatus* status;                            ///< records of the last solves
  std::array<Real*, kObservedArrays> observed;  ///< in the order of ObservedArray
  std::array<Real*, kVariedArrays> varied;      ///< in the order of VariedArray
};

/// Robots of one model, each in a lane of a vector, with all that a step needs. It has kinematics, inertia,
/// forces, contacts, their solve, and the integrator (R. Featherstone, Rigid Body Dynamics Algorithms, 2008; MuJoCo
/// documentation, "Computation"). An environment's bits depend on description, options, its own state and constants
/// alone, on whichever device. Up to 64 degrees of freedom.
template <class Real>
class ArticulatedBatch {
 public:
  /// `env_count` environments at rest, with coordinates of the description. \throws Error(invalid_argument) for a
  /// description or an option out of range, Error(unsupported) for a model beyond what is stepped here.
  ArticulatedBatch(const ArticulatedDescription& description, Offset env_count, const ArticulatedOptions& options = {});
  /// Environments that a device steps. Their arrays stay in its memory, and a span of them is a copy in host memory. It
  /// is valid until the next step, forward or reset, which copies it back if it was changed. Spans of controls, forces
  /// and constants stay valid until a reset or copy_ctrl(). No GPU has run this yet.
  /// \throws Error as above, Error(no_device) with the reason, Error(unsupported) in a build without that device.
  ArticulatedBatch(Device device, const ArticulatedDescription& description, Offset env_count,
                   const ArticulatedOptions& options = {});
  ~ArticulatedBatch();
  ArticulatedBatch(ArticulatedBatch&&) noexcept;
  ArticulatedBatch& operator=(ArticulatedBatch&&) noexcept;

  /// `count` steps of all environments, or of those whose byte of `active` is not 0 (env_count). An environment whose
  /// state, control or force is not finite stays where it is, with the code invalid_input. One whose own constant is
  /// out of range stays as well. A device is not waited for: the steps are queued on a stream, and follow those before.
  /// Without `active` and changed spans a stream may be captured. \throws Error(invalid_argument) for a negative count
  /// or another length.
  void step(Index count = 1, std::span<const std::uint8_t> active = {}, StreamRef stream = StreamRef::default_stream());
  /// Computes accelerations at the present states without a step, and writes `status` and the observed arrays. States
  /// and `qacc` stay. \throws Error(invalid_argument) for another length.
  void forward(std::span<const std::uint8_t> active = {}, StreamRef stream = StreamRef::default_stream());
  /// Puts environments whose byte of `mask` is not 0 (env_count) into the description's state, at rest, without
  /// controls and forces. Records, observed arrays and constants stay. \throws Error(invalid_argument) for another
  /// length.
  void reset(std::span<const std::uint8_t> mask, StreamRef stream = StreamRef::default_stream());
  /// Takes controls of all environments from memory of the batch's device, in the order of a stream  (env_count,
  /// actuator_count).
  void copy_ctrl(const Real* ctrl, StreamRef stream = StreamRef::default_stream());
  /// The arrays in memory of the device, for the batch's life, with what was written in spans. They may be written
  /// between steps, in the order of the steps' stream.
  [[nodiscard]] ArticulatedView<Real> view();
  /// Returns when all steps are done.
  void synchronize() const;
  /// Computes accelerations at the present states, without a step.
  [[nodiscard]] ArticulatedProbe probe();

  [[nodiscard]] std::span<Real> qpos();          ///< coordinates                              (env_count, q_count)
  [[nodiscard]] std::span<Real> qvel();          ///< velocities                               (env_count, dof_count)
  [[nodiscard]] std::span<Real> ctrl();          ///< controls, zero at first             (env_count, actuator_count)
  [[nodiscard]] std::span<Real> qfrc_applied();  ///< further forces, zero at first            (env_count, dof_count)
  [[nodiscard]] std::span<double> time();        ///< zero at first, and the step more after each [s]      (env_count)
  [[nodiscard]] std::span<Real> qacc();  ///< last accelerations, which solves start from  (env_count, dof_count)
  /// An array as the last step of a call, or `forward`, has left it: zero at first, empty without `observes_bodies`.
  /// It may be written, and no step reads it. An environment that stays where it is keeps its old numbers.
  [[nodiscard]] std::span<Real> observed(ObservedArray array);
  /// Constants of environments, the description's at first, which may be written between steps. Empty for an array that
  /// the options do not name. Inverse weights stay those of the description.
  [[nodiscard]] std::span<Real> varied(VariedArray array);
  /// How the solve of the last step or `forward` ended: a record per environment, all zero before the first.
  [[nodiscard]] std::span<const EnvStatus> status() const;
  /// Hash of all coordinates and velocities.
  [[nodiscard]] std::uint64_t hash() const;

  [[nodiscard]] Offset env_count() const;                         ///< environments
  [[nodiscard]] Index q_count() const;                            ///< coordinates of one
  [[nodiscard]] Index dof_count() const;                          ///< degrees of freedom of one
  [[nodiscard]] Index actuator_count() const;                     ///< controls of one
  [[nodiscard]] Index observed_width(ObservedArray array) const;  ///< numbers of one in that array
  [[nodiscard]] Index varied_width(VariedArray array) const;      ///< likewise

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace stiction
