#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "stiction/world.hpp"

/// Worlds to step (docs/howto/stepping.md), those of `stiction step`.
namespace stiction::scenes {

/// Positions, orientations and twists of one environment's bodies, shapes as in WorldState.
struct WorldStart {
  std::vector<double> position, orientation, twist;
};

struct WorldScene {
  std::string name, summary;
  WorldDescription description;
  TimeStepping stepping;  ///< suits the scene
  int size = 0;           ///< bodies, where that can be chosen; 0: it cannot
};

/// The names there are, in the order of docs/howto/stepping.md.
std::vector<std::string> world_names();

/// `size` bodies where the scene leaves that open; 0: as many as it has by itself. \throws Error(invalid_argument) for
/// a name that is not in world_names(), and for a size that the scene cannot have.
WorldScene make_world(const std::string& name, int size = 0);

/// Returns the start of environment `index`: a function of name, size, seed and index alone, with the same bits from
/// every compiler. \throws as make_world
WorldStart start_world(const std::string& name, std::uint64_t seed, std::uint64_t index, int size = 0);

/// Puts environments 0 to world.env_count() - 1 of a world of that scene and size to where they begin.
template <class Real>
void start_all(World<Real>& world, const std::string& name, std::uint64_t seed, int size = 0);

/// The rimless wheel of scene `walker` (McGeer, Passive dynamic walking, IJRR 9(2), 1990, section 2): eight spokes
/// about a hub that carries all mass.
struct RimlessWheel {
  static constexpr int kSpokes = 8;
  static constexpr double kLength = 1.0;       ///< hub to the foot's end [m]
  static constexpr double kFootRadius = 0.01;  ///< [m]
  static constexpr double kGyration = 0.5;     ///< square of the radius of gyration over the length [-]
  static constexpr double kSlope = 0.1;        ///< tangent of the slope [-]
};

}  // namespace stiction::scenes
