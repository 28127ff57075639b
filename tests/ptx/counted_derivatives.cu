#include "cuda/kernels/derivative_lanes_program.hpp"
#include "tests/ptx/counted.cuh"

/// The reverse pass by J and M for test_ptx_lockstep.cpp, as a build for a GPU has it.
namespace stiction {

template void* const kCounted<DerivativeLanesProgram<float>>;
template void* const kCounted<DerivativeLanesProgram<double>>;

}  // namespace stiction
