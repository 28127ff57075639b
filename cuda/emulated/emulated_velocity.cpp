#include "cuda/emulated/emulated_make.hpp"
#include "cuda/kernels/velocity_catalogue.hpp"

namespace stiction::cuda {

VelocityKernels emulated_velocity_kernels(Precision precision) {
  return precision == Precision::f32 ? velocity_kernels<MakeEmulatedKernel, float>()
                                     : velocity_kernels<MakeEmulatedKernel, double>();
}

}  // namespace stiction::cuda
