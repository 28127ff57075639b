#include "core/algorithm/solver/npgs.hpp"
#include "cuda/kernels/solve_teams.hpp"
#include "cuda/kernels/solve_thread_per_env.hpp"
#include "tests/ptx/counted.cuh"

/// `npgs` for test_ptx_lockstep.cpp, with all optimisations, as a build for a GPU has it.
namespace stiction {

template void* const kCounted<SolveThreadPerEnv<Npgs, Law::convex, float>>;
template void* const kCounted<SolveThreadPerEnv<Npgs, Law::convex, double>>;
template void* const kCounted<SolveTeams<Npgs, Law::convex, EnvPath::dense, float>>;

}  // namespace stiction
