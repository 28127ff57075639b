#pragma once

/// \file
/// Reactions of the last step as first guesses of the next, by contact (docs/howto/warm_start.md).

#include <cstdint>
#include <memory>
#include <span>

#include "stiction/bodies.hpp"
#include "stiction/jacobian_solver.hpp"
#include "stiction/solver.hpp"

namespace stiction {

/// Effect of a change of the time step on a stored reaction. The kind of lambda decides which one keeps the physics.
enum class StepScaling : std::uint8_t {
  capped = 0,  ///< min(1, dt_prev / dt): lambda is a force, and the new step starts with no more impulse lambda dt
               ///< than the last one ended with
  none = 1,    ///< 1: lambda is a force that lasts (a body at rest is carried by the same force whatever dt)
  proportional = 2,  ///< dt / dt_prev: lambda is an impulse; the force lambda / dt stays the same
};

/// Options of a WarmStartStore.
struct WarmStartOptions {
  double beta = 0.95;                         ///< part of the last reaction to start from, 0 < beta <= 1 [-]
  StepScaling scaling = StepScaling::capped;  ///< effect of a change of dt
  int threads = 0;                            ///< CPU threads; 0: all cores
};

/// Room of a store, fixed at its creation: environments of a batch, and the cones and rows of all of them together.
struct WarmStartCapacity {
  Offset envs = 0;   ///< environments of a batch
  Offset cones = 0;  ///< cones of all its environments
  Offset rows = 0;   ///< rows of all its environments
};

/// Flags of one environment since the last load began; any number of bits at once.
enum WarmStartFlag : std::uint32_t {
  kWarmStartTooLarge = 1U << 0,     ///< it ends beyond the store's cones or rows: started from zero, not stored
  kWarmStartFailed = 1U << 1,       ///< its solve ended numerical, invalid_input or unsupported: not stored
  kWarmStartNotFinite = 1U << 2,    ///< its reactions hold NaN or infinity: not stored
  kWarmStartDuplicateId = 1U << 3,  ///< two of its cones share an id: only the first of them is served
  kWarmStartReset = 1U << 4,        ///< it was reset
};

/// Record of the store for one environment. 16 bytes, no padding.
struct WarmStartRecord {
  Index hits;               ///< cones of the last load that start from a stored reaction
  Index misses;             ///< cones of the last load that start from zero
  std::uint32_t flags;      ///< WarmStartFlag bits
  std::uint32_t too_large;  ///< calls in which it did not fit, since the store was made
};
static_assert(sizeof(WarmStartRecord) == 16);

template <class Real>
class WarmStartMachine;

/// Stores the reactions of the last step and hands them out as the first guess of the next, contact by contact:
///
///     lambda_0 = beta * lambda_prev * min(1, dt_prev / dt)          (StepScaling::capped)
///
/// (warm starting of sequential impulses: Catto 2005; docs/howto/warm_start.md). A cone is known by its environment and
/// its id, which may be any 64-bit number that is unique within the environment. If cones share one, the first in the
/// batch's order is stored and served. New cones start from zero, cones that vanish are dropped, and so is a cone
/// whose kind or number of rows changed. An environment whose solve ended numerical, invalid_input or unsupported is
/// reset whole: nothing of a failure reaches the next step.
///
/// Each step: load, solve, store. Environment e of every batch is the same simulation. All memory is taken when the
/// store is made. An environment that does not fit is solved from zero, not stored, and flagged in its record. It fits
/// if its cones and rows end within the capacity. With too little room the order of environments hence matters, and
/// with enough room no environment's guess depends on another's.
template <class Real>
class WarmStartStore {
 public:
  /// An empty store on that device. \throws Error(invalid_argument) for a negative capacity or an option out of range,
  /// Error(no_device) or Error(unsupported) when the device cannot be had, Error(out_of_memory).
  WarmStartStore(Device device, const WarmStartCapacity& capacity, const WarmStartOptions& options = {});
  ~WarmStartStore();
  WarmStartStore(WarmStartStore&&) noexcept;
  WarmStartStore& operator=(WarmStartStore&&) noexcept;

  /// Writes the first guess of every row of a contact or Jacobian batch: reactions stored, brought to this step of
  /// length `dt` [s], or +0. The batch's structure must be sound (Solver::plan checks it); its numbers are not read.
  /// cone_id: (cone_count), guess: (row_count) [lambda]. Both are in the batch's memory space, which is host memory for
  /// a store on the CPU and device memory else. There the call is asynchronous on `stream` and may be captured.
  /// \throws Error(invalid_argument) before anything is written. Reasons are more environments than the store has room
  /// for, dt not finite or <= 0, an array missing, memory of another device.
  void load(const BatchLayout& batch, const std::uint64_t* cone_id, double dt, Real* guess,
            StreamRef stream = StreamRef::default_stream());

  /// Stores the reactions of this step in the place of the step before; environments beyond the batch's are reset.
  /// solution: lambda (row_count) and status (env_count) as the solver wrote them. \throws as load
  void store(const BatchLayout& batch, const std::uint64_t* cone_id, const SolutionView<Real>& solution, double dt,
             StreamRef stream = StreamRef::default_stream());

  /// Writes the first guess of contacts of bodies, three numbers each (docs/howto/bodies.md): (3 * contact_count) [N
  /// s]. \throws as load above
  void load(const BodyBatchView<Real>& batch, const std::uint64_t* contact_id, double dt, Real* guess,
            StreamRef stream = StreamRef::default_stream());
  /// Stores the impulses of contacts of bodies. \throws as load above
  void store(const BodyBatchView<Real>& batch, const std::uint64_t* contact_id, const BodySolutionView<Real>& solution,
             double dt, StreamRef stream = StreamRef::default_stream());

  /// Resets environments that start over. \throws Error(invalid_argument) for an index outside the capacity, or
  /// during a capture, which would replay this list; then nothing was reset.
  void reset(std::span<const Offset> envs, StreamRef stream = StreamRef::default_stream());
  /// Resets environment e wherever mask[e] is not zero. mask: (capacity.envs), in the store's memory space.
  /// \throws Error(invalid_argument) if mask is null.
  void reset_where(const std::uint8_t* mask, StreamRef stream = StreamRef::default_stream());
  /// Resets everything.
  void reset_all(StreamRef stream = StreamRef::default_stream());

  /// Copies the records of the first environments to the host, and waits for them.
  /// \throws Error(invalid_argument) if there are more than the capacity.
  void records(std::span<WarmStartRecord> out, StreamRef stream = StreamRef::default_stream()) const;

  /// Capacity that the store was made with.
  [[nodiscard]] const WarmStartCapacity& capacity() const noexcept { return capacity_; }
  /// Options that the store was made with.
  [[nodiscard]] const WarmStartOptions& options() const noexcept { return options_; }

 private:
  void check(const BatchLayout& batch, const std::uint64_t* cone_id, double dt) const;

  Device device_;
  WarmStartCapacity capacity_;
  WarmStartOptions options_;
  std::unique_ptr<WarmStartMachine<Real>> machine_;
};

}  // namespace stiction
