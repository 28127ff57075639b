#include "stiction/preset.hpp"

#include "core/runtime/check/expect.hpp"

namespace stiction {

SolverOptions options_for(Preset preset) noexcept {
  SolverOptions options;
  options.solver = SolverKind::automatic;
  switch (preset) {
    case Preset::navigation:
      options.tolerance = 1e-2;
      options.max_iterations = 128;
      break;
    case Preset::locomotion:
      options.tolerance = 1e-3;
      options.max_iterations = 512;
      break;
    case Preset::grasping:
      options.tolerance = 1e-4;
      options.max_iterations = 2048;
      break;
    case Preset::assembly:
      options.tolerance = 1e-6;
      options.max_iterations = 8192;
      break;
  }
  return options;
}

const char* to_string(Preset preset) noexcept {
  switch (preset) {
    case Preset::navigation:
      return "navigation";
    case Preset::locomotion:
      return "locomotion";
    case Preset::grasping:
      return "grasping";
    case Preset::assembly:
      return "assembly";
  }
  return "unknown";
}

Preset preset_from_string(const std::string& name) {
  std::string names;
  for (int k = 0; k < kPresetCount; ++k) {
    const auto preset = static_cast<Preset>(k);
    if (name == to_string(preset)) return preset;
    names += std::string(names.empty() ? "" : ", ") + to_string(preset);
  }
  refuse("preset '" + name + "' is not known; use one of: " + names);
}

}  // namespace stiction
