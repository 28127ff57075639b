#include "cuda/kernels/robots_program.hpp"
#include "cuda/native/cuda_launch.cuh"

/// Steps of robots for test_ptx_lockstep.cpp, with all optimisations, as a build for a GPU has it.
namespace stiction {

template <class Program>
void* const kCounted = reinterpret_cast<void*>(&run_teams<Program>);

template void* const kCounted<StepRobots<float>>;
template void* const kCounted<StepRobots<double>>;

}  // namespace stiction
