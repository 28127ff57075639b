#pragma once

#include "cuda/native/cuda_launch.cuh"

/// A kernel that test_ptx_lockstep.cpp counts: its instantiation puts the kernel's PTX into the object.
namespace stiction {

template <class Program>
void* const kCounted = reinterpret_cast<void*>(&run_teams<Program>);

}  // namespace stiction
