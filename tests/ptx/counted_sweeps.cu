#include "core/algorithm/solver/npgs.hpp"
#include "cuda/kernels/solve_teams.hpp"
#include "cuda/kernels/solve_thread_per_env.hpp"
#include "cuda/native/cuda_launch.cuh"

/// `npgs` for test_ptx_lockstep.cpp, with all optimisations, as a build for a GPU has it.
namespace stiction {

template <class Program>
void* const kCounted = reinterpret_cast<void*>(&run_teams<Program>);

template void* const kCounted<SolveThreadPerEnv<Npgs, Law::convex, float>>;
template void* const kCounted<SolveThreadPerEnv<Npgs, Law::convex, double>>;
template void* const kCounted<SolveTeams<Npgs, Law::convex, EnvPath::dense, float>>;

}  // namespace stiction
