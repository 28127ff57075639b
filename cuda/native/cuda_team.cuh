#pragma once

#include <cooperative_groups.h>
#include <cuda_runtime.h>

#include <type_traits>

#include "core/team/team.hpp"

namespace stiction::inline STICTION_ISA {

/// What the lanes of a CudaTeam share.
struct CudaTeamMemory {
  static constexpr int kSlotBytes = 256;
  alignas(16) unsigned char slot[2][kSlotBytes];          ///< values on their way to every lane
  alignas(16) unsigned char leaves[32 * sizeof(double)];  ///< for sums over a fixed tree
};

/// Memory of a team that is a whole grid, in global memory: one value per warp of it.
struct CudaGridMemory {
  static constexpr int kMostWarps = 16384;
  CudaTeamMemory team;
  alignas(16) unsigned char warp[2][kMostWarps * sizeof(double)];
};

/// CUDA threads that own one environment: a part of a warp, a block, or a whole cooperative grid. How many is known at
/// run time only, so that one kernel serves every class; all branches on it are uniform.
///
/// What every lane is to know passes through two slots, which alternate. A lane that fills a slot for the next but one
/// time has passed the barrier between. So has every reader of the first, so one barrier for each exchange is enough.
class CudaTeam {
 public:
  static constexpr Index kRowTile = 1;

  /// A team of `lanes` threads of a block, sharing `memory`.
  __device__ CudaTeam(CudaTeamMemory* memory, int lanes)
      : memory_(memory), rank_(static_cast<Index>(threadIdx.x) % lanes), size_(lanes) {
    const unsigned first = threadIdx.x % kWarp / lanes * lanes;
    mask_ = lanes < kWarp ? ((1U << lanes) - 1U) << first : kAllLanes;
  }
  /// The whole grid, sharing `memory`.
  __device__ explicit CudaTeam(CudaGridMemory* memory)
      : memory_(&memory->team),
        grid_(memory),
        rank_(static_cast<Index>(blockIdx.x * blockDim.x + threadIdx.x)),
        size_(static_cast<Index>(gridDim.x * blockDim.x)),
        mask_(kAllLanes) {}

  [[nodiscard]] __device__ Index rank() const { return rank_; }
  [[nodiscard]] __device__ Index size() const { return size_; }

  __device__ void sync() const {
    if (size_ <= kWarp) {
      __syncwarp(mask_);
    } else if (grid_ == nullptr) {
      __syncthreads();
    } else {
      cooperative_groups::this_grid().sync();
    }
  }

  template <class F>
  __device__ auto broadcast(F&& f) {
    using T = std::remove_cvref_t<decltype(f())>;
    static_assert(std::is_trivially_copyable_v<T> && sizeof(T) <= CudaTeamMemory::kSlotBytes);
    T* const slot = reinterpret_cast<T*>(memory_->slot[next_turn()]);
    if (rank_ == 0) *slot = f();
    sync();
    return *slot;
  }

  __device__ std::uint32_t combine(std::uint32_t bits) {
    return over_warps(__reduce_or_sync(mask_, bits), [](std::uint32_t a, std::uint32_t b) { return a | b; });
  }

  /// The sum of integers over the lanes.
  __device__ Index total(Index value) {
    return over_warps(__reduce_add_sync(mask_, value), [](Index a, Index b) { return a + b; });
  }

  template <class T>
  __device__ T max(T value) {
    const int lanes = size_ < kWarp ? size_ : kWarp;
    for (int distance = lanes / 2; distance > 0; distance /= 2)
      value = max_(__shfl_xor_sync(mask_, value, distance), value);
    return over_warps(value, [](T a, T b) { return max_(a, b); });
  }

  template <class T>
  [[nodiscard]] __device__ T* leaves() const {
    return reinterpret_cast<T*>(memory_->leaves);
  }

  __device__ Offset fetch(Offset* counter, Offset count = 1) {
    return broadcast([&] {
      return static_cast<Offset>(
          atomicAdd(reinterpret_cast<unsigned long long*>(counter), static_cast<unsigned long long>(count)));
    });
  }

 private:
  static constexpr int kWarp = 32;
  static constexpr unsigned kAllLanes = 0xffffffffU;

  __device__ int next_turn() { return turn_ ^= 1; }

  /// Joins one value per warp, equal on its lanes, into one for the team.
  template <class T, class F>
  __device__ T over_warps(T value, F&& join) {
    if (size_ <= kWarp) return value;
    const int turn = next_turn();
    T* const slot = reinterpret_cast<T*>(grid_ == nullptr ? memory_->slot[turn] : grid_->warp[turn]);
    if (rank_ % kWarp == 0) slot[rank_ / kWarp] = value;
    sync();
    T joined = slot[0];
    for (Index warp = 1; warp < size_ / kWarp; ++warp) joined = join(slot[warp], joined);
    return joined;
  }

  CudaTeamMemory* memory_;
  CudaGridMemory* grid_ = nullptr;
  Index rank_;
  Index size_;
  unsigned mask_;
  int turn_ = 0;
};

}  // namespace stiction::inline STICTION_ISA
