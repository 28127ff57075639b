#pragma once

/// \file
/// Solver options by the name of a task.

#include <cstdint>
#include <string>

#include "stiction/solver.hpp"

namespace stiction {

/// Accuracy of reactions by task, by name (docs/howto/solvers.md has the table and its reasons).
enum class Preset : std::uint8_t {
  navigation = 0,  ///< contacts keep the robot on the ground, and that is all: relative residual 1e-2
  locomotion = 1,  ///< feet must not slip or sink over a gait: 1e-3
  grasping = 2,    ///< an object is held by friction alone: 1e-4
  assembly = 3,    ///< parts mate with little play, errors add up along force chains: 1e-6; solve in f64
};
/// Number of Preset values.
inline constexpr int kPresetCount = 4;

/// Options of a preset: SolverKind::automatic, the tolerance, and iterations enough for it.
SolverOptions options_for(Preset preset) noexcept;

/// Name of a preset, as the command line takes it ("navigation", "locomotion", ...).
const char* to_string(Preset preset) noexcept;

/// The preset of that name. \throws Error(invalid_argument) that lists the names there are.
Preset preset_from_string(const std::string& name);

}  // namespace stiction
