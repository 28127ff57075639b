#pragma once

#include <cstddef>

namespace stiction::cuda {

/// Target of KernelRef::entry on a CUDA device.
struct CudaKernel {
  const void* function;  ///< a __global__ function of (Args, CudaShape)
  bool serial;           ///< every lane is a team of its own
  bool may_be_grid;      ///< one environment may have all blocks of a launch
};

/// Beside a program's own arguments. Lanes and teams of a block are its dimensions.
struct CudaShape {
  long long teams;        ///< that have something to do
  unsigned shared_bytes;  ///< of a team, beside the team's own
  void* grid_memory;      ///< CudaGridMemory if the whole grid is one team, else null
};

/// Bytes of global memory of a grid that is one team.
inline constexpr std::size_t kGridBytes = 262912;

}  // namespace stiction::cuda
