#pragma once

#include "cuda/api/robot_kernels.hpp"

namespace stiction::cuda {

/// Kernels of robots, compiled by nvcc.
const RobotKernels& cuda_robot_kernels();

}  // namespace stiction::cuda
