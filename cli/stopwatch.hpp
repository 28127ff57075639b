#pragma once

#include <chrono>

#include "stiction/thread_meter.hpp"

namespace stiction::cli {

using Clock = std::chrono::steady_clock;

inline double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

/// A call's time in seconds, and the use of its threads.
struct Timing {
  double seconds = 0;
  ThreadUse threads;
};

/// Calls solve() so often. The shortest call; a tracer is given the waits of all.
template <class F>
Timing shortest_of(int repeat, F&& solve, Tracer* tracer = nullptr) {
  Timing shortest;
  for (int turn = 0; turn < repeat; ++turn) {
    const ThreadMeter meter(tracer);
    const Clock::time_point start = Clock::now();
    solve();
    const double seconds = seconds_since(start);
    if (turn == 0 || seconds < shortest.seconds) shortest = {seconds, meter.use()};
  }
  return shortest;
}

}  // namespace stiction::cli
