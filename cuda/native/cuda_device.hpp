#pragma once

#include <cuda_runtime_api.h>

#include <string>

namespace stiction::cuda {

/// Makes a device current for a scope and restores the former one.
class DeviceGuard {
 public:
  explicit DeviceGuard(int ordinal);
  ~DeviceGuard();
  DeviceGuard(const DeviceGuard&) = delete;
  DeviceGuard& operator=(const DeviceGuard&) = delete;

 private:
  int before_ = 0;
};

/// Returns the number of devices; with none, `reason` is a sentence that says why. Never throws.
int device_count(std::string& reason);

/// Why this build cannot use device `ordinal` of `count`, or nothing. Never throws.
std::string why_unusable(int ordinal, int count);

}  // namespace stiction::cuda
