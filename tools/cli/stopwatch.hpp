#pragma once

#include <algorithm>
#include <chrono>

namespace stiction::cli {

using Clock = std::chrono::steady_clock;

inline double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

/// Calls solve() so often. The shortest time in seconds.
template <class F>
double shortest_of(int repeat, F&& solve) {
  double shortest = 0;
  for (int turn = 0; turn < repeat; ++turn) {
    const Clock::time_point start = Clock::now();
    solve();
    const double seconds = seconds_since(start);
    shortest = turn == 0 ? seconds : std::min(seconds, shortest);
  }
  return shortest;
}

}  // namespace stiction::cli
