#include "cuda/emulated/emulated_make.hpp"

namespace stiction::cuda {

WorldKernels emulated_world_kernels(Precision precision) {
  return precision == Precision::f32 ? world_kernels<MakeEmulatedKernel, float>()
                                     : world_kernels<MakeEmulatedKernel, double>();
}

}  // namespace stiction::cuda
