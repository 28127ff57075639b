#pragma once

#include "cuda/api/robot_kernels.hpp"

namespace stiction::cuda {

/// Kernels of robots, compiled for the emulated device.
const RobotKernels& emulated_robot_kernels();

}  // namespace stiction::cuda
