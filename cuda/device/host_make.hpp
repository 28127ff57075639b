#pragma once

#include "cuda/device/catalogue.hpp"
#include "cuda/device/host_launch.hpp"

namespace stiction::cuda {

struct MakeHostKernel {
  template <class Program>
  static KernelRef kernel(const char* name) {
    return host_kernel<Program>(name);
  }
};

}  // namespace stiction::cuda
