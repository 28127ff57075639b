#pragma once

/// \file
/// Whether calls became part of a CUDA graph, for those who replace solvers (docs/cuda.md).

#include <cstdint>

namespace stiction {

/// How many calls of this thread have queued work of a Solver, JacobianSolver or Derivative on a stream that was being
/// captured into a CUDA graph. The graph has pointers to the memory of what was called. So whoever puts a larger one in
/// its place reads this before and after a call, and keeps what was captured as long as the graph may be launched.
[[nodiscard]] std::uint64_t captured_calls() noexcept;

}  // namespace stiction
