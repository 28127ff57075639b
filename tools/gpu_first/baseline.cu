#include <cuda_runtime.h>

#include "cuda/native/cuda_check.hpp"
#include "tools/gpu_first/baseline.hpp"

/// The baseline on a GPU, a block an environment.
namespace stiction::gpu_first {

namespace {

/// A block of CUDA threads. `shared` holds a sum of each of its warps.
struct CudaBlock {
  float* shared;
  template <class F>
  __device__ void for_threads(F&& f) {
    f(static_cast<int>(threadIdx.x));
    __syncthreads();
  }
  template <class F>
  __device__ float sum(F&& f) {
    float part = f(static_cast<int>(threadIdx.x));
    for (int far = 16; far > 0; far /= 2) part += __shfl_xor_sync(0xffffffffU, part, far);
    if (threadIdx.x % 32 == 0) shared[threadIdx.x / 32] = part;
    __syncthreads();
    const float all = shared[0] + shared[1];
    __syncthreads();
    return all;
  }
};
static_assert(kBaselineThreads == 64, "sums are of two warps");

__global__ void __launch_bounds__(kBaselineThreads)
    baseline(const __grid_constant__ BaselineBatch batch, const __grid_constant__ BaselineAnswer answer,
             float tolerance) {
  extern __shared__ float memory[];
  __shared__ float sums[2];
  CudaBlock block{sums};
  solve_baseline(block, batch, answer, blockIdx.x, tolerance, memory);
}

}  // namespace

void launch_baseline(const BaselineBatch& batch, const BaselineAnswer& answer, float tolerance, void* stream) {
  const std::size_t bytes = BaselineMemory::floats(batch.most_rows, batch.most_dofs) * sizeof(float);
  STICTION_CUDA_TRY(
      cudaFuncSetAttribute(baseline, cudaFuncAttributeMaxDynamicSharedMemorySize, static_cast<int>(bytes)));
  baseline<<<static_cast<unsigned>(batch.envs), kBaselineThreads, bytes, static_cast<cudaStream_t>(stream)>>>(
      batch, answer, tolerance);
  STICTION_CUDA_TRY(cudaGetLastError());
}

}  // namespace stiction::gpu_first
