#pragma once

#include <array>

#include "cuda/api/kernel_catalogue.hpp"

namespace stiction::cuda {

/// Every kernel, compiled for the emulated device.
const KernelCatalogue& emulated_kernels();

/// The solvers', by SolverKind.
std::array<SolverKernels, kSolverKindCount> emulated_solver_kernels();

}  // namespace stiction::cuda
