#pragma once

/// \file
/// Tells if calls became part of a CUDA graph, for code that replaces solvers (docs/explanation/cuda.md).

#include <cstdint>

namespace stiction {

/// Returns how many calls of this thread became part of a CUDA graph. They are calls of a Solver, JacobianSolver or
/// Derivative on a stream that was being captured. The graph has pointers to the memory of the called object. Read
/// this before and after a call. If it has grown, keep the object as long as the graph may be launched.
[[nodiscard]] std::uint64_t captured_calls() noexcept;

}  // namespace stiction
