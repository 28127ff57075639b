#pragma once

#include <thread>
#include <vector>

#include "core/base/fp_env.hpp"
#include "cuda/emulated/emulated_team.hpp"

namespace stiction::cuda {

/// Runs one launch on the emulated device.
struct EmulatedLaunch {
  LaunchShape shape;          ///< as it was queued
  Offset teams;               ///< that run, one after the other
  int lanes;                  ///< threads of a team, or of a block of the grid
  int blocks;                 ///< of the grid that is one team, at once; 0: no grid, each team is a block
  std::uint64_t seed;         ///< of the lanes, which disagree about speed; 0: they do not
  std::size_t shared_bytes;   ///< of a team
  std::vector<Offset> order;  ///< team indices as they are run
};

/// Target of KernelRef::entry on the emulated device.
struct EmulatedKernel {
  void (*run)(const EmulatedLaunch& launch, const void* arguments);
};

/// Runs f(rank) on `count` threads, rank 0 on the caller's.
template <class F>
void run_on_threads(int count, const F& f) {
  std::vector<std::thread> others;
  for (int rank = 1; rank < count; ++rank) others.emplace_back(f, rank);
  f(0);
  for (std::thread& thread : others) thread.join();
}

/// Lanes are threads that live through the whole launch and meet at each team's barriers, a grid's all at one. Fast
/// memory is filled with bytes that no program may rely on; a grid has none, as on a GPU.
template <class Program>
void run_program_on_host(const EmulatedLaunch& launch, const void* arguments) {
  typename Program::Args args;
  std::memcpy(&args, arguments, sizeof(args));
  const int lanes = Program::kSerial ? 1 : launch.lanes;
  if (launch.blocks > 0) {
    EmulatedGridMemory grid(launch.blocks, lanes);
    run_on_threads(grid.width, [&](int rank) {
      const ScopedFpEnv fp_env;
      EmulatedTeam team(grid, rank, launch.seed);
      Program::run(team, TeamId{0, 1, nullptr}, args);
    });
    return;
  }
  EmulatedTeamMemory memory(lanes);
  std::vector<std::max_align_t> shared(launch.shared_bytes / sizeof(std::max_align_t) + 1);
  run_on_threads(lanes, [&](int rank) {
    const ScopedFpEnv fp_env;
    EmulatedTeam team(memory, rank, launch.seed);
    for (const Offset index : launch.order) {
      if (rank == 0) std::memset(shared.data(), 0x5a, launch.shared_bytes);
      team.sync();
      Program::run(team, TeamId{index, launch.teams, shared.data()}, args);
      team.sync();
    }
  });
}

/// The program, compiled for the emulated device.
template <class Program>
KernelRef emulated_kernel(const char* name) {
  static constexpr EmulatedKernel kKernel{run_program_on_host<Program>};
  return {name, &kKernel, sizeof(typename Program::Args)};
}

}  // namespace stiction::cuda
