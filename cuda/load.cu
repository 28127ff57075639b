#include "core/body/prepare_body.hpp"

#include "cuda/cuda_check.hpp"
#include "cuda/kernel_parts.cuh"

/// The kernels that bring environments into the solver's coordinates. They are apart from solving because they depend
/// neither on the method nor on the law: compiled once, not once for each.
namespace stiction::inline STICTION_ISA {

/// One thread per environment. Leaves the flags in the status record, for the solving kernel.
template <class Real>
__global__ void __launch_bounds__(cuda::kThreadsWidth)
    load_by_threads(const __grid_constant__ cuda::Job<Real> job, Offset method_vectors, bool needs_symmetry) {
  const Offset index = Offset{blockIdx.x} * cuda::kThreadsWidth + threadIdx.x;
  if (index >= job.count) return;
  const EnvView<Real> env = slice(job, index);
  if (env.n == 0) return;
  SerialBlock block;
  DenseSystem<Real, cuda::kWarp> system(env.counts, method_vectors, thread_workspace(job, index));
  env.status->flags = load_system(block, env, system, needs_symmetry);
}

/// One block per environment.
template <cuda::Team kTeam, class Real>
__global__ void __launch_bounds__(cuda::kWidestBlock)
    load_by_blocks(const __grid_constant__ cuda::Job<Real> job, Offset method_vectors, bool needs_symmetry) {
  __shared__ CudaBlockMemory memory;
  CudaBlock block(memory);
  const EnvView<Real> env = slice(job, blockIdx.x);
  with_block_system<kTeam>(job, env, method_vectors, [&](auto& system) {
    const std::uint32_t flags = load_system(block, env, system, needs_symmetry);
    single(block, [&] { env.status->flags = flags; });
  });
}

}  // namespace stiction::inline STICTION_ISA

namespace stiction::cuda {

namespace {

template <class Real>
void launch_any_load(const Job<Real>& job, const KernelSet& kernels, Team team, int width, cudaStream_t stream) {
  const unsigned grid = grid_size(job.count, team);
  const Offset vectors = kernels.method_vectors;
  const bool symmetry = kernels.needs_symmetry[static_cast<std::size_t>(job.law)];
  switch (team) {
    case Team::threads:
      load_by_threads<<<grid, width, 0, stream>>>(job, vectors, symmetry);
      break;
    case Team::dense_blocks:
      load_by_blocks<Team::dense_blocks><<<grid, width, 0, stream>>>(job, vectors, symmetry);
      break;
    case Team::sparse_blocks:
      load_by_blocks<Team::sparse_blocks><<<grid, width, 0, stream>>>(job, vectors, symmetry);
      break;
  }
  STICTION_CUDA_TRY(cudaGetLastError());
}

__global__ void probe() {}

}  // namespace

void launch_load(const Job<float>& job, const KernelSet& kernels, Team team, int width, cudaStream_t stream) {
  launch_any_load(job, kernels, team, width, stream);
}
void launch_load(const Job<double>& job, const KernelSet& kernels, Team team, int width, cudaStream_t stream) {
  launch_any_load(job, kernels, team, width, stream);
}

cudaError_t probe_kernel_image() {
  cudaFuncAttributes attributes;
  return cudaFuncGetAttributes(&attributes, probe);
}

}  // namespace stiction::cuda
