#pragma once

#include <thread>
#include <vector>

#include "core/base/fp_env.hpp"
#include "cuda/device/host_team.hpp"

namespace stiction::cuda {

/// How the host device runs one launch.
struct HostLaunch {
  Offset teams;               ///< that run
  int lanes;                  ///< threads of a team
  std::size_t shared_bytes;   ///< of a team
  std::vector<Offset> order;  ///< team indices as they are run
};

/// What KernelRef::entry points at on the host device.
struct HostKernel {
  void (*run)(const HostLaunch& launch, const void* arguments);
};

/// Lanes are threads that live through the whole launch and meet at each team's barriers. Fast memory is filled with
/// what no program may rely on.
template <class Program>
void run_program_on_host(const HostLaunch& launch, const void* arguments) {
  typename Program::Args args;
  std::memcpy(&args, arguments, sizeof(args));
  const int lanes = Program::kSerial ? 1 : launch.lanes;
  HostTeamMemory memory(lanes);
  std::vector<std::max_align_t> shared(launch.shared_bytes / sizeof(std::max_align_t) + 1);
  const auto run_lane = [&](int rank) {
    const ScopedFpEnv fp_env;
    HostTeam team(memory, rank);
    for (const Offset index : launch.order) {
      if (rank == 0) std::memset(shared.data(), 0x5a, launch.shared_bytes);
      team.sync();
      Program::run(team, TeamId{index, launch.teams, shared.data()}, args);
      team.sync();
    }
  };
  std::vector<std::thread> others;
  for (int rank = 1; rank < lanes; ++rank) others.emplace_back(run_lane, rank);
  run_lane(0);
  for (std::thread& thread : others) thread.join();
}

/// The program, compiled for the host device.
template <class Program>
KernelRef host_kernel(const char* name) {
  static constexpr HostKernel kKernel{run_program_on_host<Program>};
  return {name, &kKernel, sizeof(typename Program::Args)};
}

}  // namespace stiction::cuda
