#include "cuda/kernels/robots_program.hpp"
#include "tests/ptx/counted.cuh"

/// Steps of robots for test_ptx_lockstep.cpp, with all optimisations, as a build for a GPU has it.
namespace stiction {

template void* const kCounted<StepRobots<float>>;
template void* const kCounted<StepRobots<double>>;

}  // namespace stiction
