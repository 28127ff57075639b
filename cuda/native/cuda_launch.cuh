#pragma once

#include "cuda/kernels/catalogue.hpp"
#include "cuda/native/cuda_kernel.hpp"
#include "cuda/native/cuda_team.cuh"

/// Programs as kernels: each lane finds its team and runs the program.
namespace stiction::inline STICTION_ISA {

static_assert(sizeof(CudaTeamMemory) == cuda::kTeamBytes && sizeof(CudaGridMemory) == cuda::kGridBytes);

/// True if one environment may have all blocks of a launch.
template <class Program>
inline constexpr bool kMayBeGrid = requires { requires Program::kTakesDevice; };

/// True if a team of every launch is a warp or a part of one.
template <class Program>
inline constexpr bool kIsInWarp = requires { requires Program::kInWarp; };

template <class Program>
using TeamOf = CudaTeam<kMayBeGrid<Program>, kIsInWarp<Program>>;

/// One copy of the program in a kernel, whatever the team is.
template <class Program>
__device__ __noinline__ void run_as(TeamOf<Program>& team, const cuda::TeamId& id, const typename Program::Args& args) {
  Program::run(team, id, args);
}

/// Most threads of a block of this program. The fewer, the more registers a thread may have. It asks only that one
/// block fits on a multiprocessor: ptxas would keep registers for more, and move numbers to local memory.
template <class Program>
constexpr int most_threads() {
  if constexpr (requires { Program::kThreads; }) return Program::kThreads;
  return cuda::kMostLanes;
}

template <class Program>
__global__ void __launch_bounds__(most_threads<Program>(), 1)
    run_teams(const __grid_constant__ typename Program::Args args, const __grid_constant__ cuda::CudaShape shape) {
  if (shape.teams == 0) return;  // launched for the sake of its stack
  if constexpr (Program::kSerial) {
    SerialTeam team;
    const Offset index = Offset{blockIdx.x} * blockDim.x + threadIdx.x;
    const Offset count = Offset{gridDim.x} * blockDim.x;
    Program::run(team, cuda::TeamId{index, count, nullptr}, args);
  } else {
    if constexpr (kMayBeGrid<Program>) {
      if (shape.grid_memory != nullptr) {
        TeamOf<Program> team(static_cast<CudaGridMemory*>(shape.grid_memory));
        run_as<Program>(team, cuda::TeamId{0, 1, nullptr}, args);
        return;
      }
    }
    const int teams_per_block = static_cast<int>(blockDim.y);
    const int own = static_cast<int>(threadIdx.y);
    TeamOf<Program> team;
    unsigned char* const shared =
        block_memory() + teams_per_block * sizeof(CudaTeamMemory) + own * static_cast<std::size_t>(shape.shared_bytes);
    const Offset index = Offset{blockIdx.x} * teams_per_block + own;
    const Offset running = Offset{gridDim.x} * teams_per_block;
    // A team beyond those that have memory of their own has nothing to do; it never meets the others at a barrier.
    if (index >= shape.teams) return;
    run_as<Program>(team, cuda::TeamId{index, running < shape.teams ? running : shape.teams, shared}, args);
  }
}

}  // namespace stiction::inline STICTION_ISA

namespace stiction::cuda {

struct MakeCudaKernel {
  template <class Program>
  static KernelRef kernel(const char* name) {
    static const CudaKernel kernel{reinterpret_cast<const void*>(&run_teams<Program>), Program::kSerial,
                                   kMayBeGrid<Program>};
    return {name, &kernel, sizeof(typename Program::Args)};
  }
};

}  // namespace stiction::cuda
