#pragma once

#include "core/algorithm/driver/shared_instances.hpp"
#include "cuda/emulated/emulated_launch.hpp"
#include "cuda/kernels/catalogue.hpp"

namespace stiction::inline STICTION_ISA {

STICTION_SHARED_BODIES(extern, cuda::EmulatedTeam)
STICTION_SHARED_WITH_SYSTEM(extern, SerialTeam, float, DenseSystem<float, cuda::kWarp>)
STICTION_SHARED_RECORDS(extern, SerialTeam, false, DenseSystem<float, cuda::kWarp>)
STICTION_SHARED_WITH_SYSTEM(extern, SerialTeam, double, DenseSystem<double, cuda::kWarp>)
STICTION_SHARED_RECORDS(extern, SerialTeam, false, DenseSystem<double, cuda::kWarp>)

}  // namespace stiction::inline STICTION_ISA

namespace stiction::cuda {

struct MakeEmulatedKernel {
  template <class Program>
  static KernelRef kernel(const char* name) {
    return emulated_kernel<Program>(name);
  }
};

}  // namespace stiction::cuda
