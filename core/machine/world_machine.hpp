#pragma once

#include <memory>
#include <span>

#include "core/machine/world_arrays.hpp"

namespace stiction {

/// The solve of one step, in its machine's memory.
template <class Real>
struct WorldSolve {
  BodyBatchView<Real> structure;  ///< in host memory: what a plan is made of
  BodyBatchView<Real> batch;
  BodySolutionView<Real> solution;
  const Real* guess;  ///< null: none
  StreamRef stream;
};

/// Part of a world that can be read.
enum class WorldPart : std::uint8_t { state, status, contacts };

/// A world on one machine, and the stages of its step around the solve; everything was checked before. All bodies begin
/// at zero: restart() puts them somewhere.
template <class Real>
class WorldMachine {
 public:
  virtual ~WorldMachine() = default;
  /// Makes the inputs of a solve: what forces do, contacts, first guesses.
  virtual WorldSolve<Real> find_contacts() = 0;
  /// Returns when that solve is done.
  virtual void await_solve() = 0;
  virtual void integrate() = 0;

  /// The world in host memory, where that part is as the last step left it; until the next step.
  virtual WorldArrays<Real>& observe(WorldPart part) = 0;
  /// Environments of the mask go on from the state that was written into observe(state), and forget their impulses.
  virtual void restart(std::span<const std::uint8_t> mask) = 0;
  /// Everything goes on from what a checkpoint holds, whose lengths fit.
  virtual void resume(const WorldCheckpoint<Real>& from) = 0;
  /// Host memory that every step reads wrenches from.
  virtual std::span<Real> wrench() = 0;
  virtual void motion(std::span<WorldMotion> out) = 0;
};

/// \throws Error(out_of_memory) if an environment has more pairs of shapes near each other than contacts can be counted
/// of.
void check_near_pairs(Offset near, Offset env);

/// `model` must outlive the machine.
template <class Real>
std::unique_ptr<WorldMachine<Real>> make_cpu_world_machine(const WorldModelView<Real>& model, Offset env_count,
                                                           const WorldOptions& options);
template <class Real>
std::unique_ptr<WorldMachine<Real>> make_emulated_world_machine(const WorldModelView<Real>& model, Offset env_count,
                                                                const WorldOptions& options);
/// \throws Error(no_device) with the reason, Error(unsupported) in a build without CUDA.
template <class Real>
std::unique_ptr<WorldMachine<Real>> make_cuda_world_machine(int ordinal, const WorldModelView<Real>& model,
                                                            Offset env_count, const WorldOptions& options);

}  // namespace stiction
