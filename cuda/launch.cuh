#pragma once

#include "core/body/solve_body.hpp"
#include "cuda/cuda_check.hpp"
#include "cuda/kernel_parts.cuh"

/// The kernels that solve: each slices its environment, names the Block and the system, and runs a body.
namespace stiction::inline STICTION_ISA {

/// One thread per environment; flags are where loading left them.
template <class Method, Law kLaw, class Real>
__global__ void __launch_bounds__(cuda::kThreadsWidth) solve_by_threads(const __grid_constant__ cuda::Job<Real> job) {
  const Offset index = Offset{blockIdx.x} * cuda::kThreadsWidth + threadIdx.x;
  if (index >= job.count) return;
  SerialBlock block;
  const EnvView<Real> env = slice(job, index);
  if (env.n == 0) {
    answer_empty(block, env, Method::kKind);
    return;
  }
  DenseSystem<Real, cuda::kWarp> system(env.counts, Method::kVectors, thread_workspace(job, index));
  solve_loaded<Method, kLaw>(block, env, system, MethodParams<Real>{job.omega},
                             StopRule{job.tolerance, job.max_iterations, job.stall_window}, env.status->flags);
}

/// One block per environment.
template <class Method, Law kLaw, cuda::Team kTeam, class Real>
__global__ void __launch_bounds__(cuda::kWidestBlock) solve_by_blocks(const __grid_constant__ cuda::Job<Real> job) {
  __shared__ CudaBlockMemory memory;
  CudaBlock block(memory);
  const EnvView<Real> env = slice(job, blockIdx.x);
  with_block_system<kTeam>(job, env, Method::kVectors, [&](auto& system) {
    const std::uint32_t flags = env.status->flags;
    solve_loaded<Method, kLaw>(block, env, system, MethodParams<Real>{job.omega},
                               StopRule{job.tolerance, job.max_iterations, job.stall_window}, flags);
  });
}

}  // namespace stiction::inline STICTION_ISA

namespace stiction::cuda {

template <class Method, Law kLaw, class Real>
void launch_solve(const Job<Real>& job, Team team, int width, cudaStream_t stream) {
  const unsigned grid = grid_size(job.count, team);
  switch (team) {
    case Team::threads:
      solve_by_threads<Method, kLaw><<<grid, width, 0, stream>>>(job);
      break;
    case Team::dense_blocks:
      solve_by_blocks<Method, kLaw, Team::dense_blocks><<<grid, width, 0, stream>>>(job);
      break;
    case Team::sparse_blocks:
      solve_by_blocks<Method, kLaw, Team::sparse_blocks><<<grid, width, 0, stream>>>(job);
      break;
  }
  STICTION_CUDA_TRY(cudaGetLastError());
}

template <class Method, class Real>
void launch_law(const Job<Real>& job, Team team, int width, cudaStream_t stream) {
  if (job.law == Law::coulomb) {
    launch_solve<Method, Law::coulomb>(job, team, width, stream);
  } else {
    launch_solve<Method, Law::convex>(job, team, width, stream);
  }
}

template <class Method>
KernelSet kernel_set() {
  return {launch_law<Method, float>,
          launch_law<Method, double>,
          Method::kVectors,
          {Method::needs_symmetry(Law::convex), Method::needs_symmetry(Law::coulomb)}};
}

}  // namespace stiction::cuda
