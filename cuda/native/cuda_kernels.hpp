#pragma once

#include <cuda_runtime_api.h>

#include <array>

#include "cuda/api/kernel_catalogue.hpp"
#include "stiction/types.hpp"

namespace stiction::cuda {

/// Every kernel, compiled by nvcc.
const KernelCatalogue& cuda_kernels();

/// By SolverKind.
std::array<SolverKernels, kSolverKindCount> cuda_solver_kernels();
PlanKernels cuda_plan_kernels();
KernelRef cuda_trivial_kernel(Precision precision);
KernelRef cuda_choose_kernel(Precision precision);
WarmStartKernels cuda_warm_start_kernels(Precision precision);
BodyKernels cuda_body_kernels();
NewtonBodyKernels cuda_newton_body_kernels();
JacobianKernels cuda_jacobian_kernels(Precision precision);
/// Adds kernels of environments of up to kMostVelocityDofs, and of larger ones.
void add_cuda_velocity_kernels(Precision precision, VelocityKernels& to);
void add_cuda_velocity_part_kernels(Precision precision, VelocityKernels& to);
WorldKernels cuda_world_kernels(Precision precision);
DerivativePair cuda_derivative_kernels(Precision precision);
DerivativePair cuda_relaxed_kernels(Precision precision);
KernelRef cuda_unrolled_kernel(Precision precision);
KernelRef cuda_lanes_kernel(Precision precision);

/// Succeeds if this build has machine code or PTX that the current device can run.
cudaError_t probe_kernel_image();

}  // namespace stiction::cuda
