#pragma once

#include <cstddef>

#include "stiction/types.hpp"

namespace stiction::cuda {

/// A launch of Newton's method in velocities.
struct VelocityTeamLimits {
  int lanes;          ///< of a team
  std::size_t bytes;  ///< of fast memory that it may have at most
};

/// Launches one after the other; each takes environments that fit and that no launch before has tried. Two teams of
/// the first share a warp, and six such warps a multiprocessor of 227 KB. They reach speed only.
inline constexpr VelocityTeamLimits kVelocityTeams[] = {{16, std::size_t{18000}}, {32, ~std::size_t{0}}};

/// Rules by which teams are launched. They reach speed only: other rules are for tests that they change no bit.
struct VelocityRules {
  Offset many_per_processor = 62;  ///< environments of a batch, from which a lane each has the device: 8184 on an H200
};

}  // namespace stiction::cuda
