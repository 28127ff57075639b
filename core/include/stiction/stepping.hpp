#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "stiction/bodies.hpp"
#include "stiction/jacobian_solver.hpp"
#include "stiction/solver.hpp"
#include "stiction/warm_start.hpp"

/// \file
/// The solvers of a simulation loop, one for each form of a batch. There is one call per step, and every step starts
/// from the last one's reactions, contact by contact. Each is a solver and a WarmStartStore that share a device.
///
///     SteppingSolver<float> solver(Device::cuda(), options, capacity);
///     each step:  solver.solve(batch, cone_id, dt, solution, stream);   // asynchronous, captured once, replayed
///                 solver.reset_where(done_mask, stream);                // environments that start over
namespace stiction {

/// Base of the stepping solvers: memory of the last step, and ways to reset it.
template <class Real>
class StepMemory {
 public:
  /// Resets the reactions of environments that start over. \throws as WarmStartStore::reset.
  void reset(std::span<const Offset> envs, StreamRef stream = StreamRef::default_stream());
  /// Resets environment e wherever mask[e] is not zero. mask: (capacity.envs), in the device's memory.
  /// \throws as WarmStartStore::reset_where.
  void reset_where(const std::uint8_t* mask, StreamRef stream = StreamRef::default_stream());
  /// Resets everything.
  void reset_all(StreamRef stream = StreamRef::default_stream());

  /// The store, with its records.
  [[nodiscard]] const WarmStartStore<Real>& store() const noexcept { return store_; }

 protected:
  StepMemory(Device device, const WarmStartCapacity& capacity, const WarmStartOptions& options)
      : store_(device, capacity, options) {}

  /// \throws Error(invalid_argument) if the batch has more rows than there is room for.
  void check_rows(Offset row_count) const;
  /// Loads the first guess, calls solve(first guess), and stores the reactions.
  template <class Batch, class Answer, class Solve>
  void step(const Batch& batch, const std::uint64_t* id, double dt, const Answer& answer, StreamRef stream,
            Solve&& solve) {
    store_.load(batch, id, dt, guess_.get(), stream);
    solve(static_cast<const Real*>(guess_.get()));
    store_.store(batch, id, answer, dt, stream);
  }

  WarmStartStore<Real> store_;
  std::shared_ptr<Real> guess_;  ///< first guess of every row, on the device; its solver makes it  (capacity.rows)
};

/// Steps of contact batches. Nothing is allocated after construction.
template <class Real>
class SteppingSolver : public StepMemory<Real> {
 public:
  /// capacity: of every batch to come (envs, rows and cones at least; on a GPU all of it).
  /// \throws Error(invalid_argument) for an option out of range or a capacity without environments. Error(no_device),
  /// Error(unsupported) or Error(out_of_memory) when the device or its memory cannot be had.
  SteppingSolver(Device device, const SolverOptions& options, const Capacity& capacity,
                 const WarmStartOptions& warm_start = {});

  /// Loads, solves and stores a step of length `dt` [s]. cone_id: contact ids, unique within an environment
  /// (cone_count), in the batch's memory space. \throws as Solver::solve and WarmStartStore::load, before anything is
  /// written.
  void solve(const ContactBatchView<Real>& batch, const std::uint64_t* cone_id, double dt,
             const SolutionView<Real>& solution, StreamRef stream = StreamRef::default_stream());

  /// Returns when the work queued on `stream` is done. \throws Error(device_failure) if it failed.
  void synchronize(StreamRef stream = StreamRef::default_stream()) const { solver_.synchronize(stream); }
  /// The solver, with its options and device.
  [[nodiscard]] const Solver& solver() const noexcept { return solver_; }

 private:
  Solver solver_;
};

/// Steps of Jacobian batches. Nothing is allocated after construction, but on the CPU, which assembles into arrays that
/// grow with the batch.
template <class Real>
class JacobianSteppingSolver : public StepMemory<Real> {
 public:
  /// capacity: of every batch to come; on the CPU envs, rows and cones of it. \throws as SteppingSolver.
  JacobianSteppingSolver(Device device, const SolverOptions& options, const JacobianCapacity& capacity,
                         const WarmStartOptions& warm_start = {}, FactorUse use = FactorUse::by_size);

  /// Loads, solves and stores a step of length `dt` [s], as SteppingSolver::solve. Stored reactions stay as they were
  /// if a number is rejected (InvalidPolicy::reject). \throws as JacobianSolver::solve and WarmStartStore::load.
  void solve(const JacobianBatchView<Real>& batch, const std::uint64_t* cone_id, double dt,
             const JacobianSolutionView<Real>& solution, StreamRef stream = StreamRef::default_stream());

  /// Returns when the work queued on `stream` is done. \throws Error(device_failure) if it failed.
  void synchronize(StreamRef stream = StreamRef::default_stream()) const { solver_.synchronize(stream); }
  /// The solver, with its capacity.
  [[nodiscard]] const JacobianSolver<Real>& solver() const noexcept { return solver_; }

 private:
  JacobianSolver<Real> solver_;
};

/// Steps of body batches. Contacts are known by the batch's contact_id, and a step is as long as its time
/// stepping.
template <class Real>
class BodySteppingSolver : public StepMemory<Real> {
 public:
  /// Reactions of bodies are impulses.
  static constexpr WarmStartOptions kImpulses{0.95, StepScaling::proportional, 0};

  /// Room for `contacts` contacts of all `envs` environments together; the solver itself makes room with its plans.
  /// \throws Error(invalid_argument) for an option out of range or no environments, Error(no_device),
  /// Error(unsupported) or Error(out_of_memory) when the device or its memory cannot be had.
  BodySteppingSolver(Device device, const TimeStepping& stepping, const BodySolverOptions& options, Offset envs,
                     Offset contacts, const WarmStartOptions& warm_start = kImpulses);

  /// Plans, loads, solves and stores a step. A batch in device memory is waited for.
  /// \throws as BodySolver::plan, BodySolver::solve and WarmStartStore::load, before anything is written.
  void solve(const BodyBatchView<Real>& batch, const BodySolutionView<Real>& solution,
             StreamRef stream = StreamRef::default_stream());
  /// Loads, solves and stores a step with a plan of the caller's, asynchronously on `stream`.
  /// \throws as BodySolver::solve and WarmStartStore::load, before anything is written.
  void solve(const BodyPlan& plan, const BodyBatchView<Real>& batch, const BodySolutionView<Real>& solution,
             StreamRef stream = StreamRef::default_stream());

  /// Other time stepping or options from the next step on; stored impulses stay. \throws as the constructor
  void change(const TimeStepping& stepping, const BodySolverOptions& options);

  /// Returns when the work queued on `stream` is done. \throws Error(device_failure) if it failed.
  void synchronize(StreamRef stream = StreamRef::default_stream()) const { memory_.synchronize(stream); }
  /// The solver, with its options and device.
  [[nodiscard]] const BodySolver& solver() const noexcept { return solver_; }

 private:
  BodySolver solver_;
  Solver memory_;  ///< solves nothing: a BodySolver has neither arrays nor a way to wait
};

}  // namespace stiction
