#include "cuda/native/cuda_inline.cuh"

#include "core/algorithm/velocity/lanes/dof_islands.hpp"
#include "cuda/kernels/velocity_program.hpp"
#include "cuda/kernels/velocity_teams_program.hpp"
#include "tests/ptx/counted.cuh"

/// Newton's method in velocities for test_ptx_lockstep.cpp, with all optimisations, as a build for a GPU has it.
namespace stiction {

template void* const kCounted<SolveVelocityTeams<float, float>>;
template void* const kCounted<SolveVelocityTeams<double, double>>;
template void* const kCounted<SolveVelocities<float, float, false>>;
template void* const kCounted<SolveVelocities<double, double, false>>;

}  // namespace stiction
