#include "cuda/kernels/robot_catalogue.hpp"
#include "cuda/native/cuda_launch.cuh"
#include "cuda/native/cuda_robots.hpp"

namespace stiction::cuda {

const RobotKernels& cuda_robot_kernels() {
  static const RobotKernels kernels = robot_kernels<MakeCudaKernel>();
  return kernels;
}

}  // namespace stiction::cuda
