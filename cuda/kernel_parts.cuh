#pragma once

#include "core/body/dense_system.hpp"
#include "core/body/sparse_system.hpp"
#include "cuda/cuda_block.cuh"
#include "cuda/job.hpp"

/// What every kernel begins with: its environment, and that environment's system in the workspace.
namespace stiction::inline STICTION_ISA {

/// The environment at `index` of a job's launch.
template <class Real>
__device__ EnvView<Real> slice(const cuda::Job<Real>& job, Offset index) {
  return slice(job.batch, job.plan, job.law, job.warm_start, job.lambda, job.w, job.status, job.envs[index]);
}

/// Where a thread finds its environment's part of the workspace: a warp's 32 environments interleave theirs, so that
/// equal shapes in lock-step touch neighbouring addresses; each is laid out for its own cones.
template <class Real>
__device__ Real* thread_workspace(const cuda::Job<Real>& job, Offset index) {
  return job.workspace + job.offsets[index / cuda::kWarp] + index % cuda::kWarp;
}

/// f(system) on the system of `env` that a block works on.
template <cuda::Team kTeam, class Real, class F>
__device__ void with_block_system(const cuda::Job<Real>& job, const EnvView<Real>& env, Offset method_vectors, F&& f) {
  Real* const workspace = job.workspace + job.offsets[blockIdx.x];
  if constexpr (kTeam == cuda::Team::dense_blocks) {
    DenseSystem<Real> system(env.counts, method_vectors, workspace);
    f(system);
  } else {
    SparseSystem<Real> system(env, method_vectors, workspace);
    f(system);
  }
}

}  // namespace stiction::inline STICTION_ISA

namespace stiction::cuda {

/// Blocks of a launch.
inline unsigned grid_size(Offset count, Team team) {
  return static_cast<unsigned>(team == Team::threads ? (count + kThreadsWidth - 1) / kThreadsWidth : count);
}

}  // namespace stiction::cuda
