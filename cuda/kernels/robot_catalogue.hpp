#pragma once

#include "cuda/api/robot_kernels.hpp"
#include "cuda/kernels/reset_robots_program.hpp"
#include "cuda/kernels/robots_program.hpp"

namespace stiction::cuda {

template <class Make>
RobotKernels robot_kernels() {
  return {{Make::template kernel<StepRobots<float>>("step_robots"),
           Make::template kernel<StepRobots<double>>("step_robots")},
          {Make::template kernel<ResetRobots<float>>("reset_robots"),
           Make::template kernel<ResetRobots<double>>("reset_robots")}};
}

}  // namespace stiction::cuda
