#pragma once

#include "cuda/device/kernels.hpp"

namespace stiction::cuda {

/// Every kernel, compiled for the emulated device.
const KernelCatalogue& emulated_kernels();

}  // namespace stiction::cuda
