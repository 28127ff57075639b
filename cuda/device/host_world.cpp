#include "cuda/device/host_make.hpp"

namespace stiction::cuda {

WorldKernels host_world_kernels(Precision precision) {
  return precision == Precision::f32 ? world_kernels<MakeHostKernel, float>() : world_kernels<MakeHostKernel, double>();
}

}  // namespace stiction::cuda
