#pragma once

/// \file
/// Bodies and contact points in place of a matrix (docs/howto/bodies.md).

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "stiction/body_space.hpp"
#include "stiction/solver.hpp"

namespace stiction {

/// Rigid bodies and contact points of many environments at one instant, as `BodySolver` reads them
/// (docs/howto/bodies.md). A POD that owns nothing. All vectors are in world axes; a twist is (velocity of the centre
/// of mass [m/s], angular velocity [rad/s]). Bodies of all environments follow one another, contacts likewise. Body
/// numbers count from the environment's own first body, and -1 is the world, which stands still.
///
/// u = (velocity of b's point) - (velocity of a's point) is a contact's relative velocity, and n, t1, t2 its frame: the
/// normal, and contact_tangents(). Reactions are impulses (n, t1, t2) on b; a gets the opposite.
template <class Real>
struct BodyBatchView {
  Offset env_count = 0;                         ///< environments
  Offset body_count = 0;                        ///< bodies of all environments
  Offset contact_count = 0;                     ///< contacts of all environments
  const Offset* env_body_offsets = nullptr;     ///< first body of each environment                  (env_count + 1)
  const Offset* env_contact_offsets = nullptr;  ///< first contact of each environment               (env_count + 1)
  const Real* inv_mass = nullptr;               ///< 1 / mass, >= 0 [1/kg]                            (body_count)
  const Real* inv_inertia = nullptr;            ///< inverse inertia about the centre of mass: xx, xy, xz, yy, yz, zz
                                      ///< [1/(kg m^2)]                                               (6 * body_count)
  const Real* twist = nullptr;         ///< at the beginning of the step                               (6 * body_count)
  const Real* twist_change = nullptr;  ///< what gravity and all other forces but contact change it by over the
                                       ///< whole step; null: nothing                            (6 * body_count)
  const std::uint8_t* kinematic = nullptr;  ///< nonzero: moves with `twist` whatever pushes it; its masses and
                                            ///< twist_change are not used; null: none                (body_count)
  const Index* body_a = nullptr;            ///< -1: the world; never equal to body_b                 (contact_count)
  const Index* body_b = nullptr;            ///< -1: the world                                        (contact_count)
  const Real* arm_a = nullptr;              ///< contact point from a's centre of mass [m]; of the world: any number
                                ///<                                                      (3 * contact_count)
  const Real* arm_b = nullptr;        ///< contact point from b's centre of mass [m]            (3 * contact_count)
  const Real* normal = nullptr;       ///< unit vector from a to b                              (3 * contact_count)
  const Real* mu = nullptr;           ///< friction, >= 0 [-]                                   (contact_count)
  const Real* depth = nullptr;        ///< penetration; negative: a gap [m]                     (contact_count)
  const Real* restitution = nullptr;  ///< Newton's, in [0, 1] [-]                              (contact_count)
  const std::uint64_t* contact_id = nullptr;  ///< the caller's names, not read by the solver; may be null
                                              ///<                                                    (contact_count)
  MemorySpace space = MemorySpace::host;      ///< where all arrays are
};

/// One environment to be appended to a BodyBatch.
template <class Real>
struct BodyEnvironment {
  /// One body, world axes.
  struct Body {
    Real inv_mass = 1;                                  ///< 1 / mass, >= 0 [1/kg]
    std::array<Real, 6> inv_inertia{1, 0, 0, 1, 0, 1};  ///< xx, xy, xz, yy, yz, zz [1/(kg m^2)]
    std::array<Real, 6> twist{};                        ///< velocity [m/s], spin [rad/s]
    std::array<Real, 6> twist_change{};                 ///< by all forces but contact over the step
    bool kinematic = false;                             ///< moves with `twist` whatever pushes it
  };
  /// One contact point between two bodies, world axes.
  struct Contact {
    Index body_a = -1;                    ///< -1: the world
    Index body_b = 0;                     ///< -1: the world
    std::array<Real, 3> arm_a{};          ///< the point from a's centre of mass [m]
    std::array<Real, 3> arm_b{};          ///< the point from b's centre of mass [m]
    std::array<Real, 3> normal{0, 0, 1};  ///< unit vector from a to b
    Real mu = 0;                          ///< friction, >= 0 [-]
    Real depth = 0;                       ///< penetration; negative: a gap [m]
    Real restitution = 0;                 ///< Newton's, in [0, 1] [-]
    std::uint64_t id = 0;                 ///< the caller's name of the contact
  };
  std::vector<Body> bodies;       ///< bodies; contacts name them by their place here
  std::vector<Contact> contacts;  ///< contacts
};

/// The arrays of a batch of bodies on the host, shapes as in BodyBatchView.
template <class Real>
struct BodyArrays {
  std::vector<Offset> env_body_offsets{0};     ///< first body of each environment                   (env_count + 1)
  std::vector<Offset> env_contact_offsets{0};  ///< first contact of each environment                (env_count + 1)
  std::vector<Real> inv_mass;                  ///< 1 / mass [1/kg]                                  (body_count)
  std::vector<Real> inv_inertia;               ///< xx, xy, xz, yy, yz, zz [1/(kg m^2)]              (6 * body_count)
  std::vector<Real> twist;                     ///< at the beginning of the step [m/s], [rad/s]      (6 * body_count)
  std::vector<Real> twist_change;              ///< by all forces but contact, or empty              (6 * body_count)
  std::vector<std::uint8_t> kinematic;         ///< nonzero: moves whatever pushes it, or empty      (body_count)
  std::vector<Index> body_a;                   ///< -1: the world                                    (contact_count)
  std::vector<Index> body_b;                   ///< -1: the world                                    (contact_count)
  std::vector<Real> arm_a;                     ///< contact point from a's centre of mass [m]        (3 * contact_count)
  std::vector<Real> arm_b;                     ///< contact point from b's centre of mass [m]        (3 * contact_count)
  std::vector<Real> normal;                    ///< unit vector from a to b                          (3 * contact_count)
  std::vector<Real> mu;                        ///< friction [-]                                     (contact_count)
  std::vector<Real> depth;                     ///< penetration [m]                                  (contact_count)
  std::vector<Real> restitution;               ///< Newton's [-]                                     (contact_count)
  std::vector<std::uint64_t> contact_id;       ///< the caller's names, or empty                     (contact_count)

  /// The batch as BodySolver reads it; valid while no array grows.
  [[nodiscard]] BodyBatchView<Real> view() const noexcept;
};

/// Owner of a batch of bodies on the host; append-only.
template <class Real>
class BodyBatch {
 public:
  /// Appends one environment (possibly empty). \throws Error(invalid_argument) if a contact names a body that is not
  /// there or joins a body with itself; then nothing was appended. Values are the business of validate().
  void add(const BodyEnvironment<Real>& environment);

  /// The batch as BodySolver reads it, in host memory; valid while the batch lives and is not appended to.
  [[nodiscard]] BodyBatchView<Real> view() const noexcept { return arrays_.view(); }
  /// Environments so far.
  [[nodiscard]] Offset env_count() const noexcept { return static_cast<Offset>(arrays_.env_body_offsets.size()) - 1; }
  /// Bodies of all environments.
  [[nodiscard]] Offset body_count() const noexcept { return arrays_.env_body_offsets.back(); }
  /// Contacts of all environments.
  [[nodiscard]] Offset contact_count() const noexcept { return arrays_.env_contact_offsets.back(); }

 private:
  BodyArrays<Real> arrays_;
};

/// Every broken precondition of a host batch, at most `limit` of them, structure first; `Defect::cone` is the contact
/// and `Defect::row` the body it is about. An empty result means that the batch is sound.
template <class Real>
std::vector<Defect> validate(const BodyBatchView<Real>& batch, std::size_t limit = 64);

namespace detail {

/// contact_tangents() from the sign of n_z and -1 / (sign + n_z), of one normal or of several side by side.
template <class Real>
STICTION_HD void complete_tangents(const Real (&n)[3], Real sign, Real a, Real (&t1)[3], Real (&t2)[3]) {
  const Real b = n[0] * n[1] * a;
  t1[0] = Real(1) + sign * n[0] * n[0] * a;
  t1[1] = sign * b;
  t1[2] = -sign * n[0];
  t2[0] = b;
  t2[1] = sign + n[1] * n[1] * a;
  t2[2] = -n[1];
}

}  // namespace detail

/// Computes the two tangents that complete a unit normal to a right-handed frame (n, t1, t2). (Duff et al., Building
/// an orthonormal basis, revisited, JCGT 6(1), 2017.) One division, continuous but for the sign of n_z, and the same
/// bits everywhere. A contact's reactions and warm start are in this frame.
template <class Real>
STICTION_HD void contact_tangents(const Real (&n)[3], Real (&t1)[3], Real (&t2)[3]) {
  const Real sign = n[2] < Real(0) ? Real(-1) : Real(1);
  detail::complete_tangents(n, sign, Real(-1) / (sign + n[2]), t1, t2);
}

/// Conversion of a step to b and R (docs/howto/bodies.md). With h = dt / substeps, u the relative velocity at the
/// beginning of the (sub-)step and u_free the one that forces without contacts would give it:
///
///     b = u_free - (v, 0, 0),   v = max(v_position, v_bounce),   R = cfm / h on all three rows
///     v_position = erp * max(depth - slop, 0) / h for depth >= 0,   depth / h for a gap
///     v_bounce = -restitution * u_n where -u_n > restitution_threshold and the gap closes within h, else none
struct TimeStepping {
  double dt = 0.005;                   ///< the step, > 0 [s]
  double erp = 0.2;                    ///< share of a penetration that is undone in one (sub-)step, in [0, 1] [-]
  double slop = 0;                     ///< penetration that is left alone, >= 0 [m]
  double cfm = 0;                      ///< velocity a contact yields per force, >= 0 [m/(N s)]
  double restitution_threshold = 0.1;  ///< approach slower than this does not bounce, >= 0 [m/s]
};

/// Options of a body solver: sequential impulses, projected Gauss-Seidel on velocities without a matrix
/// (docs/math/si.md), or by an inexact Newton method on velocities (docs/math/body_newton.md).
struct BodySolverOptions {
  Law law = Law::coulomb;     ///< of friction
  bool box_friction = false;  ///< friction is boxed (docs/math/box_friction.md): each tangent of
                              ///< contact_tangents() has bounds of its own, and `law` is not read. Impulses alone
  BodyMethod method = BodyMethod::impulses;  ///< how
  BodySpaceOptions space;                    ///< read by Newton's method alone
  Index iterations = 50;                     ///< sweeps, or Newton steps, of each sub-step, at most, >= 0
  double tolerance = 0;                      ///< on the relative residual of the last sub-step; 0: all iterations [-]
  double absolute_tolerance = 0;             ///< on its absolute residual; solved is where either holds [m/s]
  bool momentum = true;                      ///< Nesterov's, with restart, for sweeps
  double omega = 1.0;                        ///< relaxation, 0 < omega < 2 [-]
  /// `pairs`: a sweep visits contacts between the same two bodies, up to four, twice before it goes on. Newton
  /// takes none. Bodies have no A that `strong` could read.
  BlockMode blocks = BlockMode::cones;
  /// Under the convex law, by impulses, in one sub-step, on the CPU. Several threads that sweep one environment
  /// together (from 4096 contacts on) wait for no colour, until the last sweeps (docs/math/si.md). No two runs
  /// need have equal bits; all else that a solve promises holds.
  bool asynchronous = false;
  Index substeps = 1;              ///< the step in that many equal parts, >= 1 (Macklin et al. 2019)
  Index max_contacts_per_env = 0;  ///< 0: no limit; else that many deepest contacts of an environment are solved, the
                                   ///< lower index first among equals, and the environment gets kFlagContactsDropped
  int threads = 0;                 ///< CPU threads; 0: all cores
  InvalidPolicy invalid = InvalidPolicy::reject;  ///< policy for numbers that break a precondition
};

/// Outputs of a solve. Same memory space as the batch.
template <class Real>
struct BodySolutionView {
  Real* impulse = nullptr;      ///< reactions in the contact frame, summed over sub-steps [N s]  (3 * contact_count)
  Real* twist = nullptr;        ///< after the step                                                (6 * body_count)
  Real* w = nullptr;            ///< residual motion of the last sub-step [m/s]; may be null       (3 * contact_count)
  EnvStatus* status = nullptr;  ///< `solver` says npgs with momentum, pgs without; newton, or multigrid if that
                                ///< preconditions it                                              (env_count)
};

struct BodyPlanData;

/// The integers of a body solve: colours, order, and which bodies touch. Depends on offsets, body numbers, `kinematic`
/// and, in environments over capacity only, on depths. Cheap to copy.
class BodyPlan {
 public:
  /// A plan over data that BodySolver::plan() made.
  explicit BodyPlan(std::shared_ptr<const BodyPlanData> data) : data_(std::move(data)) {}
  /// The plan's integers.
  [[nodiscard]] const BodyPlanData& data() const noexcept { return *data_; }
  /// The plan's integers, to be kept beyond the plan.
  [[nodiscard]] const std::shared_ptr<const BodyPlanData>& shared() const noexcept { return data_; }
  /// Colours of one environment: phases of one sweep.
  [[nodiscard]] Index color_count(Offset env) const;

 private:
  std::shared_ptr<const BodyPlanData> data_;
};

class BodyMachine;

/// Solves body batches on one device.
class BodySolver {
 public:
  /// A solver on that device. \throws Error(invalid_argument) for an option out of range, Error(no_device) or
  /// Error(unsupported) when the device cannot be had.
  BodySolver(Device device, const TimeStepping& stepping, const BodySolverOptions& options);
  ~BodySolver();
  BodySolver(BodySolver&&) noexcept;
  BodySolver& operator=(BodySolver&&) noexcept;

  /// Plans batches of this structure. A batch in device memory is planned from a host copy of its structure, on
  /// `stream`. \throws Error(invalid_argument) if the structure is broken.
  template <class Real>
  [[nodiscard]] BodyPlan plan(const BodyBatchView<Real>& batch, StreamRef stream = StreamRef::default_stream()) const;

  /// Solves every environment. `warm_start` (3 * contact_count, impulses of the whole step, same space) may be null:
  /// start from zero. For a batch and a solution in device memory it is asynchronous on `stream`. Only the first solve
  /// with a plan is not, since it copies the plan to the device. In host memory it is complete on return.
  /// \throws Error before anything is written; numerical trouble is in solution.status.
  template <class Real>
  void solve(const BodyPlan& plan, const BodyBatchView<Real>& batch, const BodySolutionView<Real>& solution,
             const Real* warm_start = nullptr, StreamRef stream = StreamRef::default_stream()) const;

  /// Solves without a plan of the caller's, for bodies and contacts that change from call to call. One is made for
  /// this call, as plan() makes it, so a batch in device memory is waited for. The structure is checked once, where
  /// plan() and solve() check it each.
  template <class Real>
  void solve(const BodyBatchView<Real>& batch, const BodySolutionView<Real>& solution, const Real* warm_start = nullptr,
             StreamRef stream = StreamRef::default_stream()) const;

  /// Throws solve()'s errors for these arguments; writes nothing.
  template <class Real>
  void check(const BodyPlan& plan, const BodyBatchView<Real>& batch, const BodySolutionView<Real>& solution) const;

  /// Options that the solver was made with.
  [[nodiscard]] const BodySolverOptions& options() const noexcept { return options_; }
  /// Time stepping that the solver was made with.
  [[nodiscard]] const TimeStepping& stepping() const noexcept { return stepping_; }
  /// Device that it solves on.
  [[nodiscard]] Device device() const noexcept { return device_; }

 private:
  template <class Real>
  void check_space(const BodyBatchView<Real>& batch) const;
  template <class Real>
  void check(const BodyPlan& plan, const BodyBatchView<Real>& batch, const BodySolutionView<Real>& solution,
             const Real* warm_start) const;
  /// The plan of a host batch whose structure is known to be sound.
  template <class Real>
  [[nodiscard]] BodyPlan make_plan(const BodyBatchView<Real>& host) const;

  Device device_;
  TimeStepping stepping_;
  BodySolverOptions options_;
  std::unique_ptr<BodyMachine> machine_;
};

/// Host solution with owned memory; shapes as in BodySolutionView.
template <class Real>
struct BodySolution {
  std::vector<Real> impulse;      ///< reactions in the contact frame [N s]  (3 * contact_count)
  std::vector<Real> twist;        ///< velocity [m/s], spin [rad/s] after the step  (6 * body_count)
  std::vector<Real> w;            ///< residual motion of the last sub-step [m/s]  (3 * contact_count)
  std::vector<EnvStatus> status;  ///< one record each  (env_count)
};

/// Plans and solves a host batch in one call. \throws as BodySolver, its plan() and solve().
template <class Real>
BodySolution<Real> solve_bodies(const BodyBatch<Real>& batch, const TimeStepping& stepping = {},
                                const BodySolverOptions& options = {}, Device device = Device::cpu(),
                                std::span<const Real> warm_start = {});

/// Bytes of one contact that a sweep reads or writes, bodies not counted: geometry, block, impulse and body numbers.
template <class Real>
Offset contact_bytes(Law law, bool momentum);

}  // namespace stiction
