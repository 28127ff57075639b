#include "cuda/emulated/emulated_robots.hpp"

#include "cuda/emulated/emulated_make.hpp"
#include "cuda/kernels/robot_catalogue.hpp"

namespace stiction::cuda {

const RobotKernels& emulated_robot_kernels() {
  static const RobotKernels kernels = robot_kernels<MakeEmulatedKernel>();
  return kernels;
}

}  // namespace stiction::cuda
