#pragma once

/// \file
/// The solver of Jacobian batches, on the CPU or a GPU (docs/howto/jacobian.md).

#include <memory>

#include "stiction/jacobian.hpp"
#include "stiction/solver.hpp"

namespace stiction {

/// Room that a JacobianSolver on a GPU has, taken when it is made. On the CPU room is made as it is needed.
struct JacobianCapacity {
  Offset envs = 0;            ///< environments of a batch
  Offset rows = 0;            ///< rows of a batch, room between environments included
  Offset cones = 0;           ///< cones of a batch, room between environments included
  Index env_rows = 0;         ///< rows of the largest environment
  Index env_dofs = 0;         ///< degrees of freedom of the largest
  Offset matrix = 0;          ///< entries of all A together: n^2 of each environment that keeps its matrix
  Offset factor = 0;          ///< entries of all Y together: n dofs of each that is kept as a factor
  bool semidefinite = false;  ///< whether cones of semidefinite will come

  /// Returns the needs of a host batch. \throws Error(invalid_argument) if its structure is broken.
  template <class Real>
  static JacobianCapacity of(const JacobianBatchView<Real>& batch, FactorUse use = FactorUse::by_size);
  /// Needs of any batch of `envs` environments whose largest has so many rows, cones and degrees of freedom.
  static JacobianCapacity of_largest(Offset envs, Index env_rows, Index env_cones, Index env_dofs,
                                     FactorUse use = FactorUse::by_size);
};

/// Returns true if a solve of J and M with these options begins with Newton's method in velocities, which takes M as a
/// matrix (docs/math/auto.md). Islands apart are solved as separate environments, by solvers of A.
[[nodiscard]] inline bool takes_newton(const SolverOptions& options) noexcept {
  return options.solver == SolverKind::automatic && options.islands == IslandMode::together &&
         options.choose == SolverChoice::named;
}

/// Outputs of a JacobianSolver; same memory space as the batch. Reactions and motion lie where the batch has the row,
/// and rows that it does not use are not written.
template <class Real>
struct JacobianSolutionView {
  Real* lambda = nullptr;       ///< reactions [lambda]                          (row_count)
  Real* w = nullptr;            ///< residual motion [w], may be null            (row_count)
  Real* velocity = nullptr;     ///< v_free + M^-1 J' lambda [v], may be null    (dof_count)
  EnvStatus* status = nullptr;  ///< one record each                             (env_count)

  /// The part that a contact batch's solution has.
  operator SolutionView<Real>() const { return {lambda, w, status}; }
};

template <class Real>
class JacobianMachine;

/// Solves Jacobian batches where they are, on the host or on a device: assembles, solves, and moves the velocities
/// (docs/howto/jacobian.md). With takes_newton(), environments that Newton's method in velocities solves are not
/// assembled. On every device the same bits.
template <class Real>
class JacobianSolver {
 public:
  /// A solver on that device. \throws Error(invalid_argument) for an option out of range or a negative capacity,
  /// Error(no_device) or Error(unsupported) when the device cannot be had, Error(out_of_memory).
  JacobianSolver(Device device, const SolverOptions& options, const JacobianCapacity& capacity,
                 FactorUse use = FactorUse::by_size);
  ~JacobianSolver();
  JacobianSolver(JacobianSolver&&) noexcept;
  JacobianSolver& operator=(JacobianSolver&&) noexcept;

  /// Solves every environment. `start` is in the batch's memory. Its arrays may be the solution's own reactions and
  /// velocities: an environment's start is read before its answer is written.
  ///
  /// A batch in device memory is read there, its integers too, in the order of `stream`; nothing waits, nothing is
  /// allocated. Queued work can be captured into a graph and replayed after numbers, contacts and counts have changed
  /// in place. Solves on several streams follow one another. An environment larger than the capacity is marked
  /// kFlagOverCapacity. If A or Y run out of room, the first that does not fit and every later one of its form is
  /// flagged, too. One whose offsets or columns are out of order is marked kFlagBadStructure and its velocity is not
  /// written. All these leave the others alone, and so does one with kFlagBadMass, whose velocity is its v_free. A
  /// batch in host memory is solved by the CPU, complete on return. \throws Error(invalid_argument), before anything
  /// is written, if the batch is not in this solver's memory. Also if it has more environments, rows or cones than
  /// there is room for. Also if it lacks an array, and on the CPU if its structure is broken or, with
  /// InvalidPolicy::reject, a number.
  void solve(const JacobianBatchView<Real>& batch, const JacobianSolutionView<Real>& solution,
             const JacobianStart<Real>& start, StreamRef stream = StreamRef::default_stream());
  /// Solves every environment from reactions, or from zero where `warm_start` is null.
  void solve(const JacobianBatchView<Real>& batch, const JacobianSolutionView<Real>& solution,
             const Real* warm_start = nullptr, StreamRef stream = StreamRef::default_stream()) {
    solve(batch, solution, JacobianStart<Real>{warm_start, nullptr}, stream);
  }

  /// Throws solve()'s errors for these arguments, but for numbers; writes nothing.
  void check(const JacobianBatchView<Real>& batch, const JacobianSolutionView<Real>& solution,
             const JacobianStart<Real>& start = {}) const;

  /// Returns when the work queued on `stream` is done; at once on the CPU. \throws Error(device_failure) if it failed.
  void synchronize(StreamRef stream = StreamRef::default_stream()) const { solver_.synchronize(stream); }

  /// The solver of assembled environments.
  [[nodiscard]] const Solver& solver() const noexcept { return solver_; }
  /// Capacity that the solver was made with.
  [[nodiscard]] const JacobianCapacity& capacity() const noexcept { return capacity_; }

 private:
  JacobianCapacity capacity_;
  Solver solver_;
  std::unique_ptr<JacobianMachine<Real>> machine_;
};

}  // namespace stiction
