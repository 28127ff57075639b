#pragma once

#include "cuda/api/kernel.hpp"

namespace stiction::cuda {

/// Kernels of robots in lanes. They are apart from KernelCatalogue, so that no solver is compiled anew for them.
struct RobotKernels {
  KernelRef step[2];   ///< by Precision                                   (kernels/robots_program.hpp)
  KernelRef reset[2];  ///< likewise                                       (kernels/reset_robots_program.hpp)
};

}  // namespace stiction::cuda
