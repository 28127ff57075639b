#include "cuda/native/cuda_kernels.hpp"
#include "cuda/native/cuda_launch.cuh"

namespace stiction::cuda {

PlanKernels cuda_plan_kernels() {
  return plan_kernels<MakeCudaKernel>();
}

KernelRef cuda_trivial_kernel(Precision precision) {
  return precision == Precision::f32 ? MakeCudaKernel::kernel<AnswerTrivial<float>>("answer_trivial")
                                     : MakeCudaKernel::kernel<AnswerTrivial<double>>("answer_trivial");
}

KernelRef cuda_choose_kernel(Precision precision) {
  return precision == Precision::f32 ? MakeCudaKernel::kernel<ChooseEnvironments<float>>("choose")
                                     : MakeCudaKernel::kernel<ChooseEnvironments<double>>("choose");
}

namespace {

__global__ void probe() {}

}  // namespace

cudaError_t probe_kernel_image() {
  cudaFuncAttributes attributes;
  return cudaFuncGetAttributes(&attributes, probe);
}

}  // namespace stiction::cuda
