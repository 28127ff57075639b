#pragma once

#include "bench/scenes/worlds.hpp"
#include "tools/cli/commands.hpp"
#include "tools/cli/step_report.hpp"

namespace stiction::cli {

WorldOptions world_options(const StepArguments& arguments, const TimeStepping& stepping);

/// Steps a scene's world as the arguments say, and writes its states and checkpoints. What concerns the device, the
/// seed and the clock's surroundings is left to the caller. `solve` answers the contacts of a step in place of the
/// world's own solver; empty: it does.
template <class Real>
StepReport step_world(const StepArguments& arguments, const scenes::WorldScene& scene, Device device,
                      const StepSolver<Real>& solve = {});

}  // namespace stiction::cli
