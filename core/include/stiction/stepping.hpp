#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "stiction/solver.hpp"
#include "stiction/warm_start.hpp"

namespace stiction {

/// A simulation loop's solver: one call per step, every step started from the last one's reactions, contact by contact.
///
///     SteppingSolver<float> solver(Device::cuda(), options, capacity);
///     each step:  solver.solve(batch, cone_id, dt, solution, stream);   // asynchronous, captured once, replayed
///                 solver.reset_where(done_mask, stream);                // environments that start over
///
/// It is a Solver and a WarmStartStore that share a device and a capacity; nothing is allocated after construction.
template <class Real>
class SteppingSolver {
 public:
  /// capacity: of every batch to come (envs, rows and cones at least; on a GPU all of it).
  /// \throws Error(invalid_argument) for an option out of range or a capacity without environments, Error(no_device),
  /// Error(unsupported) or Error(out_of_memory) when the device or its memory cannot be had.
  SteppingSolver(Device device, const SolverOptions& options, const Capacity& capacity,
                 const WarmStartOptions& warm_start = {});
  ~SteppingSolver();
  SteppingSolver(SteppingSolver&&) noexcept;
  SteppingSolver& operator=(SteppingSolver&&) noexcept;

  /// Recalls, solves and remembers a step of length `dt` [s]. cone_id: contact ids, unique within an environment
  /// (cone_count), in the batch's memory space. \throws as Solver::solve and WarmStartStore::recall, before anything is
  /// written.
  void solve(const ContactBatchView<Real>& batch, const std::uint64_t* cone_id, double dt,
             const SolutionView<Real>& solution, StreamRef stream = StreamRef::default_stream());

  /// Forgets the reactions of environments that start over: a list, or wherever mask[e] is not zero (capacity.envs, in
  /// the device's memory), or all. \throws as WarmStartStore::reset.
  void reset(std::span<const Offset> envs, StreamRef stream = StreamRef::default_stream());
  void reset_where(const std::uint8_t* mask, StreamRef stream = StreamRef::default_stream());
  void reset_all(StreamRef stream = StreamRef::default_stream());

  [[nodiscard]] const Solver& solver() const noexcept { return solver_; }
  [[nodiscard]] const WarmStartStore<Real>& store() const noexcept { return store_; }

 private:
  Solver solver_;
  WarmStartStore<Real> store_;
  std::shared_ptr<Real> guess_;  ///< first guess of every row, on the device  (capacity.rows)
};

}  // namespace stiction
