#pragma once

#include <cuda_runtime_api.h>

#include <functional>

#include "stiction/types.hpp"

namespace stiction::cuda {

/// Returns true if graphs of the current device leave out work behind a condition, and do it where it holds. A graph
/// is made and launched to see it. Must not be called during a capture.
bool finds_conditions();

/// Puts the work that `body` queues on `inner` into a node of the graph that `stream` is being captured into. The
/// graph does it if the integer at `condition` is not 0 then. Needs finds_conditions(). \throws Error(device_failure),
/// and the errors of `body`.
void capture_conditionally(const Offset* condition, cudaStream_t stream, cudaStream_t inner,
                           const std::function<void()>& body);

}  // namespace stiction::cuda
