#pragma once

#include <cuda_runtime_api.h>

#include "core/base/plan_view.hpp"
#include "cuda/layout.hpp"
#include "stiction/batch.hpp"
#include "stiction/status.hpp"

namespace stiction::cuda {

/// One solve on the GPU, as plain data in device memory: what every kernel is given.
template <class Real>
struct Job {
  ContactBatchView<Real> batch;
  PlanView plan;
  const Real* warm_start;
  Real* lambda;
  Real* w;
  EnvStatus* status;
  double tolerance;
  Index max_iterations;
  Index stall_window;
  Real omega;
  Law law;
  const Offset* envs;     ///< environments of this launch                                         (count)
  const Offset* offsets;  ///< first number in the workspace: of each warp for Team::threads, else of each environment
  Offset count;
  Real* workspace;
};

/// Starts the solving kernel of one solver on `stream`. \throws Error if the device refuses it.
template <class Real>
using LaunchSolve = void (*)(const Job<Real>& job, Team team, int width, cudaStream_t stream);

/// One solver in both precisions, and what loading must know about it.
struct KernelSet {
  LaunchSolve<float> f32;
  LaunchSolve<double> f64;
  Offset method_vectors;   ///< vectors of n numbers the method keeps beside the system
  bool needs_symmetry[2];  ///< by Law: whether an asymmetric A is to be refused
};

KernelSet pgs_kernels();
KernelSet npgs_kernels();
KernelSet jacobi_kernels();
KernelSet apgd_kernels();

/// Starts the kernel that brings environments into the solver's coordinates. \throws Error if the device refuses it.
void launch_load(const Job<float>& job, const KernelSet& kernels, Team team, int width, cudaStream_t stream);
void launch_load(const Job<double>& job, const KernelSet& kernels, Team team, int width, cudaStream_t stream);

/// Whether this build has machine code or PTX that the current device can run.
cudaError_t probe_kernel_image();

}  // namespace stiction::cuda
