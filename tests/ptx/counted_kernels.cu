#include "core/algorithm/solver/npgs.hpp"
#include "core/algorithm/velocity/lanes/dof_islands.hpp"
#include "cuda/kernels/solve_teams.hpp"
#include "cuda/kernels/solve_thread_per_env.hpp"
#include "cuda/kernels/velocity_program.hpp"
#include "cuda/kernels/velocity_teams_program.hpp"
#include "cuda/native/cuda_launch.cuh"

/// The kernels that test_ptx_lockstep.cpp counts, with all optimisations, as a build for a GPU has them.
namespace stiction {

template <class Program>
void* const kCounted = reinterpret_cast<void*>(&run_teams<Program>);

template void* const kCounted<SolveVelocityTeams<float, float>>;
template void* const kCounted<SolveVelocityTeams<double, double>>;
template void* const kCounted<SolveVelocities<float, float, false>>;
template void* const kCounted<SolveVelocities<double, double, false>>;
template void* const kCounted<SolveThreadPerEnv<Npgs, Law::convex, float>>;
template void* const kCounted<SolveThreadPerEnv<Npgs, Law::convex, double>>;
template void* const kCounted<SolveTeams<Npgs, Law::convex, EnvPath::dense, float>>;

}  // namespace stiction
