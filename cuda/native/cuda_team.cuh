#pragma once

#include <cooperative_groups.h>
#include <cuda_runtime.h>

#include <type_traits>

#include "core/team/team.hpp"
#include "cuda/api/kernel.hpp"

namespace stiction::inline STICTION_ISA {

/// Memory that the lanes of a CudaTeam share.
struct CudaTeamMemory {
  static constexpr int kSlotBytes = 256;
  alignas(16) unsigned char slot[2][kSlotBytes];          ///< values on their way to every lane
  alignas(16) unsigned char leaves[32 * sizeof(double)];  ///< for sums over a fixed tree
};

/// Memory of a team that is a whole grid, in global memory: one value per block of it.
struct CudaGridMemory {
  static constexpr int kMostBlocks = 16384;
  CudaTeamMemory team;
  alignas(16) unsigned char block[2][kMostBlocks * sizeof(double)];
};

/// Returns a block's dynamic shared memory: that of its teams, then that of programs.
__device__ inline unsigned char* block_memory() {
  extern __shared__ __align__(16) unsigned char memory[];
  return memory;
}

/// Out of line: a barrier of the grid is long, and an algorithm has many.
__device__ __noinline__ inline void sync_grid() {
  cooperative_groups::this_grid().sync();
}

/// CUDA threads that own one environment: a part of a warp, a block, or a whole cooperative grid. How many is known at
/// run time only, so that one kernel serves every class; all branches on it are uniform. With kIsInWarp it is a warp at
/// most, and no barrier asks.
///
/// A block is `blockDim.x` lanes of each of `blockDim.y` teams. A team in a part of a warp has its shape in special
/// registers. An object would lie in local memory, since it is handed to functions, and be read again at every step.
///
/// In a block or a grid values pass through two slots, which alternate. A lane that fills a slot for the next but one
/// time has passed the barrier between. Every reader of the first has, too, so one barrier for each exchange is enough.
template <bool kMayBeGrid, bool kIsInWarp = false>
class CudaTeam {
  static_assert(!kMayBeGrid || !kIsInWarp);

 public:
  static constexpr Index kRowTile = 1;

  /// The team of this thread in its block.
  __device__ CudaTeam() {}
  /// The whole grid, sharing `memory`.
  __device__ explicit CudaTeam(CudaGridMemory* memory) : grid_(memory) {}

  [[nodiscard]] __device__ Index rank() const {
    const auto own = static_cast<Index>(threadIdx.x);
    return is_grid() ? static_cast<Index>(blockIdx.x) * static_cast<Index>(blockDim.x) + own : own;
  }
  [[nodiscard]] __device__ Index size() const { return is_grid() ? static_cast<Index>(gridDim.x) * lanes() : lanes(); }

  __device__ void sync() const {
    if constexpr (kIsInWarp) {
      __syncwarp(mask());
    } else if (lanes() == kWarp) {
      __syncwarp();
    } else if (lanes() < kWarp) {
      __syncwarp(mask());
    } else if (is_grid()) {
      sync_grid();
    } else {
      __syncthreads();
    }
  }

  /// f is compiled once, whatever the team is: only then comes the way that its value takes.
  template <class F>
  __device__ auto broadcast(F&& f) {
    using T = std::remove_cvref_t<decltype(f())>;
    static_assert(std::is_trivially_copyable_v<T> && sizeof(T) <= CudaTeamMemory::kSlotBytes);
    Box<T> box;
    if (rank() == 0) box.value = f();
    if (!kIsInWarp && lanes() > kWarp) {
      through_slots(box);
    } else if constexpr (sizeof(T) <= kShuffledBytes) {
      shuffle(box);
    } else {
      through_slot(box);
    }
    return box.value;
  }

  __device__ std::uint32_t combine(std::uint32_t bits) {
    const std::uint32_t joined = with_mask([&](unsigned mask) { return __reduce_or_sync(mask, bits); });
    return over_warps(joined, std::uint32_t{0}, [](std::uint32_t a, std::uint32_t b) { return a | b; });
  }

  /// The sum of integers over the lanes.
  __device__ Index total(Index value) {
    const Index sum = with_mask([&](unsigned mask) { return __reduce_add_sync(mask, value); });
    return over_warps(sum, Index{0}, [](Index a, Index b) { return a + b; });
  }

  template <class T>
  __device__ T max(T value) {
    const T largest = with_mask([&](unsigned mask) {
      T joined = value;
      for (int distance = (lanes() < kWarp ? lanes() : kWarp) / 2; distance > 0; distance /= 2)
        joined = max_(__shfl_xor_sync(mask, joined, distance), joined);
      return joined;
    });
    return over_warps(largest, largest, [](T a, T b) { return max_(a, b); });
  }

  template <class T>
  [[nodiscard]] __device__ T* leaves() const {
    return reinterpret_cast<T*>(memory().leaves);
  }

  __device__ Offset fetch(Offset* counter, Offset count = 1) {
    return broadcast([&] {
      return static_cast<Offset>(
          atomicAdd(reinterpret_cast<unsigned long long*>(counter), static_cast<unsigned long long>(count)));
    });
  }

 private:
  static constexpr int kWarp = cuda::kWarp;
  static constexpr unsigned kAllLanes = 0xffffffffU;
  static constexpr std::size_t kShuffledBytes = 8;  ///< more take as long by way of memory

  /// Lanes of the team, or of each of its blocks.
  [[nodiscard]] static __device__ Index lanes() { return static_cast<Index>(blockDim.x); }
  [[nodiscard]] __device__ bool is_grid() const {
    if constexpr (kMayBeGrid) return grid_ != nullptr;
    return false;
  }
  [[nodiscard]] __device__ CudaTeamMemory& memory() const { return is_grid() ? grid_->team : own_block(); }
  /// The team's part of its warp.
  [[nodiscard]] static __device__ unsigned mask() {
    return kAllLanes >> (kWarp - lanes()) << (static_cast<Index>(threadIdx.y) * lanes()) % kWarp;
  }
  /// f(mask) of this warp's lanes of the team. A mask that is a constant costs nothing.
  template <class F>
  static __device__ auto with_mask(F&& f) {
    return !kIsInWarp && lanes() >= kWarp ? f(kAllLanes) : f(mask());
  }

  __device__ int next_turn() { return turn_ ^= 1; }

  /// A value, which the first lane alone sets.
  template <class T>
  union Box {
    __device__ Box() : word{} {}
    unsigned word[(sizeof(T) + sizeof(unsigned) - 1) / sizeof(unsigned)];
    T value;
  };

  /// The first lane's value to all lanes of a part of a warp.
  template <class T>
  __device__ void shuffle(Box<T>& box) const {
    with_mask([&](unsigned mask) {
      for (unsigned& word : box.word) word = __shfl_sync(mask, word, 0, lanes());
    });
    sync();  // a shuffle orders no memory
  }

  /// The first lane's value by way of memory. A second barrier stands for a second slot: within a warp it costs
  /// nothing.
  template <class T>
  __device__ void through_slot(Box<T>& box) const {
    T* const slot = reinterpret_cast<T*>(memory().slot[0]);
    if (threadIdx.x == 0) *slot = box.value;
    sync();
    box.value = *slot;
    sync();
  }

  /// The first lane's value to all lanes of a block or a grid.
  template <class T>
  __device__ void through_slots(Box<T>& box) {
    T* const slot = reinterpret_cast<T*>(memory().slot[next_turn()]);
    if (rank() == 0) *slot = box.value;
    sync();
    box.value = *slot;
  }

  /// Joins one value per warp, equal on its lanes, into one for the team.
  template <class T, class F>
  __device__ T over_warps(T value, T nothing, F&& join) {
    if (kIsInWarp || lanes() <= kWarp) return value;
    const int turn = next_turn();
    T* const slot = reinterpret_cast<T*>(own_block().slot[turn]);
    if (threadIdx.x % kWarp == 0) slot[threadIdx.x / kWarp] = value;
    __syncthreads();
    T joined = slot[0];
    for (Index warp = 1; warp < lanes() / kWarp; ++warp) joined = join(slot[warp], joined);
    return is_grid() ? over_blocks(joined, nothing, turn, join) : joined;
  }

  /// Joins one value per block, equal on its lanes. Each warp reads them all, a lane every 32nd.
  template <class T, class F>
  __device__ T over_blocks(T value, T nothing, int turn, F&& join) {
    T* const slot = reinterpret_cast<T*>(grid_->block[turn]);
    if (threadIdx.x == 0) slot[blockIdx.x] = value;
    sync_grid();
    T joined = nothing;
    for (unsigned block = threadIdx.x % kWarp; block < gridDim.x; block += kWarp) joined = join(slot[block], joined);
    for (int distance = kWarp / 2; distance > 0; distance /= 2)
      joined = join(__shfl_xor_sync(kAllLanes, joined, distance), joined);
    return joined;
  }

  /// Returns the memory that the lanes of a block share, whole team or not.
  [[nodiscard]] __device__ CudaTeamMemory& own_block() const {
    return reinterpret_cast<CudaTeamMemory*>(block_memory())[threadIdx.y];
  }

  CudaGridMemory* grid_ = nullptr;
  int turn_ = 0;
};

}  // namespace stiction::inline STICTION_ISA
