#pragma once

namespace stiction {

/// Counts a call of this thread in captured_calls(). To be called by a machine that queues work on a stream which is
/// being captured.
void count_captured_call() noexcept;

}  // namespace stiction
