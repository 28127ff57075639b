#pragma once

#include <thread>
#include <vector>

#include "cuda/emulated/emulated_team.hpp"

/// A GPU block on the CPU: the emulated device's team of real threads that meet at a barrier and at nothing else. It
/// offers what the concept promises and no more (one barrier an exchange, as CudaTeam does). So an algorithm with a
/// missing sync races here too.
namespace stiction::test {

using TortureTeam = cuda::EmulatedTeamMemory;

/// With any number of rows in a lane's tile, which must not show.
template <Index kTile>
class StressTeam : public cuda::EmulatedTeam {
 public:
  static constexpr Index kRowTile = kTile;
  using cuda::EmulatedTeam::EmulatedTeam;
};

/// Runs f(team) on each of `width` threads, on the team that make(shared, rank) gives it.
template <class Make, class F>
void run_stressed(Index width, Make&& make, F&& f) {
  TortureTeam shared(width);
  std::vector<std::thread> threads;
  for (Index rank = 0; rank < width; ++rank)
    threads.emplace_back([&, rank] {
      auto team = make(shared, rank);
      f(team);
    });
  for (std::thread& thread : threads) thread.join();
}

/// Runs f(team) on a StressTeam of `width` threads.
template <Index kTile, class F>
void run_stressed(Index width, F&& f) {
  run_stressed(width, [](TortureTeam& shared, Index rank) { return StressTeam<kTile>(shared, rank); }, f);
}

}  // namespace stiction::test
