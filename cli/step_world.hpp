#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "cli/commands.hpp"
#include "cli/step_monitor.hpp"
#include "cli/step_report.hpp"
#include "scenes/worlds.hpp"

namespace stiction::cli {

/// First line of a file of states.
inline constexpr const char* kStateHeader = "step,environment,body,x,y,z,qw,qx,qy,qz,vx,vy,vz,wx,wy,wz\n";
/// The line of one body, closed by a line feed. `of` holds its numbers alone.
template <class Real>
std::string state_line(std::int64_t step, Offset env, Index body, const WorldState<Real>& of);

WorldOptions world_options(const StepArguments& arguments, const TimeStepping& stepping);

/// A world that run_steps() steps, and its files: in one process, or in several.
class SteppedWorld {
 public:
  virtual ~SteppedWorld() = default;
  /// Resumes from its checkpoint, if there is one; returns how many steps were made.
  virtual std::int64_t resume() = 0;
  virtual void step() = 0;
  [[nodiscard]] virtual std::vector<WorldMotion> motion() = 0;
  [[nodiscard]] virtual std::vector<EnvSeen> see() = 0;
  /// Appends states to its file.
  virtual void write_states(std::int64_t step) = 0;
  /// After the last of them. \throws Error(io) if something was not written.
  virtual void close_states() = 0;
  /// Writes its checkpoint after that step, if it is its turn.
  virtual void write_checkpoint(std::int64_t step) = 0;
  [[nodiscard]] virtual WorldSeconds seconds() = 0;
  /// Returns the hash of the environments that the arguments select.
  [[nodiscard]] virtual std::uint64_t hash() = 0;
};

/// Makes the steps, and writes states and checkpoints. The device, the seed and the clock's surroundings are left to
/// the caller.
StepReport run_steps(const StepArguments& arguments, const WorldOptions& options, const WorldDescription& description,
                     Device device, SteppedWorld& world);

/// To be called before a world is described. `bodies`: of an environment. `ranks`: processes that share its states,
/// each of which has all of its description.
/// \throws Error(out_of_memory) if the state alone of all environments is more than there is.
void require_world_memory(const StepArguments& arguments, std::int64_t bodies, Precision precision, int ranks = 1);

/// Steps a scene's world in this process.
template <class Real>
StepReport step_world(const StepArguments& arguments, const scenes::WorldScene& scene, Device device);

}  // namespace stiction::cli
