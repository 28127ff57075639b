#include "cuda/native/cuda_inline.cuh"

#include "cuda/kernels/velocity_program.hpp"
#include "cuda/kernels/velocity_teams_program.hpp"
#pragma pop_macro("STICTION_HD_OUTLINE")

#include "cuda/kernels/velocity_catalogue.hpp"
#include "cuda/native/cuda_kernels.hpp"
#include "cuda/native/cuda_launch.cuh"

namespace stiction::cuda {

void add_cuda_velocity_kernels(Precision precision, VelocityKernels& to) {
  precision == Precision::f32 ? add_velocity_kernels<MakeCudaKernel, float>(to)
                              : add_velocity_kernels<MakeCudaKernel, double>(to);
}

}  // namespace stiction::cuda
