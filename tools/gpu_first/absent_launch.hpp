#pragma once

#include "cuda/kernels/catalogue.hpp"
#include "cuda/native/cuda_kernel.hpp"

/// In place of cuda/native/cuda_launch.cuh in a source whose kernels are left out (tools/prebuilt_cuda.py): the
/// catalogue has their names and nothing behind them. A launch of one fails as that of an invalid device function.
namespace stiction::cuda {

struct MakeCudaKernel {
  template <class Program>
  static KernelRef kernel(const char* name) {
    static const CudaKernel kernel{nullptr, Program::kSerial, false};
    return {name, &kernel, sizeof(typename Program::Args)};
  }
};

}  // namespace stiction::cuda
