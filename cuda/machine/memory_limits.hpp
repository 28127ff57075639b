#pragma once

#include "stiction/types.hpp"

namespace stiction::cuda {

/// Most device memory for the scratch of all teams that take derivatives or factors, unless a single one needs more.
inline constexpr Offset kScratchBytes = Offset{1} << 29;
/// Teams that take derivatives or factors, for each processor of the device.
inline constexpr Offset kTeamsPerProcessor = 16;
/// Most device memory that the systems of one class may take, unless a single one needs more. Beyond it fewer teams
/// take more environments each.
inline constexpr Offset kWorkspaceBytes = Offset{1} << 30;

}  // namespace stiction::cuda
