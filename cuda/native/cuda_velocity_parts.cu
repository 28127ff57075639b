#include "cuda/kernels/velocity_catalogue.hpp"
#include "cuda/native/cuda_kernels.hpp"
#include "cuda/native/cuda_launch.cuh"

/// Kernels for large environments have two sizes of everything: with copies of functions (cuda_inline.cuh) they would
/// take half an hour to compile.
namespace stiction::cuda {

void add_cuda_velocity_part_kernels(Precision precision, VelocityKernels& to) {
  precision == Precision::f32 ? add_velocity_part_kernels<MakeCudaKernel, float>(to)
                              : add_velocity_part_kernels<MakeCudaKernel, double>(to);
}

}  // namespace stiction::cuda
