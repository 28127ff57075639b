#pragma once

#include "core/base/extents.hpp"
#include "cuda/api/device_api.hpp"
#include "cuda/native/cuda_kernel.hpp"

/// Threads and fast memory of a launch's blocks. Apart from CudaApi, because the executor of generated code on the CPU
/// launches it in these shapes.
namespace stiction::cuda {

/// A launch in CUDA's terms, but for how many blocks there are.
struct LaunchGrid {
  int block = 0;           ///< threads of a block
  int width = 0;           ///< of these, the first dimension: lanes of a team
  std::size_t shared = 0;  ///< fast memory of a block [bytes]
  Offset teams_per_block = 0;
  CudaShape shape{};
};

/// Blocks of a launch on a device with these facts. `grid_memory` is for launches of the whole device.
inline LaunchGrid launch_grid(const LaunchShape& shape, bool serial, const DeviceFacts& facts, void* grid_memory) {
  const std::size_t own_bytes = in_shared(shape.shared_bytes);
  const auto shared_of = [&](int threads) {
    if (serial) return std::size_t{0};
    if (shape.whole_device) return kTeamBytes;
    return static_cast<std::size_t>(threads / shape.lanes) * (kTeamBytes + own_bytes);
  };
  LaunchGrid grid;
  // A team of more than a warp waits by the block's barrier, so it has the block to itself.
  grid.block = shape.lanes > kWarp ? shape.lanes : kTeamThreads;
  // Two blocks at least on a multiprocessor, where teams are small enough for that.
  while (grid.block > larger_of(shape.lanes, kWarp) && 2 * shared_of(grid.block) > facts.resident_shared_bytes)
    grid.block /= 2;
  // No multiprocessor is left idle for the sake of a larger block.
  while (!shape.whole_device && grid.block > larger_of(shape.lanes, kWarp) &&
         shape.teams * shape.lanes < Offset{grid.block} * facts.processors)
    grid.block /= 2;
  grid.width = serial ? grid.block : shape.lanes;
  grid.shared = shared_of(grid.block);
  grid.teams_per_block = serial ? grid.block : grid.block / shape.lanes;
  grid.shape = {shape.teams, static_cast<unsigned>(own_bytes), shape.whole_device ? grid_memory : nullptr};
  return grid;
}

/// Blocks that a launch asks for, if so many run at once.
inline Offset blocks_of(const LaunchShape& shape, const LaunchGrid& grid, Offset resident) {
  if (shape.whole_device) return resident;
  return smaller_of(resident, (shape.teams + grid.teams_per_block - 1) / grid.teams_per_block);
}

}  // namespace stiction::cuda
