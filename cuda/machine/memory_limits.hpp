#pragma once

#include "core/base/extents.hpp"
#include "cuda/api/device_api.hpp"

namespace stiction::cuda {

/// Most device memory for the scratch of all teams that take derivatives or factors, unless a single one needs more.
inline Offset most_scratch_bytes(const DeviceFacts& facts) {
  return larger_of(Offset{1} << 29, static_cast<Offset>(facts.memory_bytes / 16));
}
/// Teams that take derivatives or factors, for each processor of the device.
inline constexpr Offset kTeamsPerProcessor = 16;
/// Most device memory that the systems of one class may take, unless a single one needs more. Beyond it fewer teams
/// take more environments each.
inline Offset most_workspace_bytes(const DeviceFacts& facts) {
  return larger_of(Offset{1} << 30, static_cast<Offset>(facts.memory_bytes / 16));
}

}  // namespace stiction::cuda
