#pragma once

#include <cstdint>
#include <thread>
#include <type_traits>
#include <vector>

#include "cuda/emulated/emulated_team.hpp"

/// A GPU block on the CPU: the emulated device's team of real threads that meet at a barrier and at nothing else. It
/// offers the concept's promises and no more (one barrier an exchange, as CudaTeam does). An algorithm with a missing
/// sync hence races here too.
namespace stiction::test {

template <Index kTile>
class TiledTeam : public cuda::EmulatedTeam {
 public:
  static constexpr Index kRowTile = kTile;
  using cuda::EmulatedTeam::EmulatedTeam;
};

/// With any number of rows in a lane's tile, which must not show.
template <Index kTile>
using StressTeam = std::conditional_t<kTile == cuda::EmulatedTeam::kRowTile, cuda::EmulatedTeam, TiledTeam<kTile>>;

/// Runs f(team) on each of `width` threads. With a seed the threads disagree about speed.
template <Index kTile = cuda::EmulatedTeam::kRowTile, class F>
void run_stressed(Index width, F&& f, std::uint64_t seed = 0) {
  cuda::EmulatedTeamMemory shared(width);
  std::vector<std::thread> threads;
  for (Index rank = 0; rank < width; ++rank)
    threads.emplace_back([&, rank] {
      StressTeam<kTile> team(shared, rank, seed);
      f(team);
    });
  for (std::thread& thread : threads) thread.join();
}

}  // namespace stiction::test
