#pragma once

#include <optional>
#include <string>

#include "stiction/solver.hpp"

namespace stiction::test {

/// The first CUDA device that can be used; with none, `reason` is the one that devices() gives.
inline std::optional<Device> usable_cuda(std::string& reason) {
  for (const DeviceReport& report : devices()) {
    if (report.device.kind != DeviceKind::cuda) continue;
    if (report.usable) return report.device;
    reason += (reason.empty() ? "" : "; ") + report.reason;
  }
  return std::nullopt;
}

}  // namespace stiction::test
