#pragma once

#include <cuda_runtime.h>

#include <type_traits>

#include "core/block/block.hpp"

namespace stiction::inline STICTION_ISA {

/// What the threads of a CudaBlock share.
struct CudaBlockMemory {
  static constexpr int kSlotBytes = 256;
  alignas(16) unsigned char slot[2][kSlotBytes];          ///< values on their way to every lane
  alignas(16) unsigned char leaves[32 * sizeof(double)];  ///< for sums over a fixed tree
};

/// A block of CUDA threads that owns one environment; its width is a multiple of the warp's.
///
/// Whatever every lane is to know passes through one of two slots in turn. A lane that fills a slot for the next but
/// one time has passed the barrier between, and so has every reader of the first, so one barrier for each exchange is
/// enough.
class CudaBlock {
 public:
  static constexpr Index kRowTile = 1;

  __device__ explicit CudaBlock(CudaBlockMemory& memory) : memory_(&memory) {}

  [[nodiscard]] __device__ Index rank() const { return static_cast<Index>(threadIdx.x); }
  [[nodiscard]] __device__ Index size() const { return static_cast<Index>(blockDim.x); }
  __device__ void sync() const { __syncthreads(); }

  template <class F>
  __device__ auto broadcast(F&& f) {
    using T = std::remove_cvref_t<decltype(f())>;
    T* const slot = next_slot<T, 1>();
    if (threadIdx.x == 0) *slot = f();
    __syncthreads();
    return *slot;
  }

  __device__ std::uint32_t combine(std::uint32_t bits) {
    return over_warps(__reduce_or_sync(kAllLanes, bits), [](std::uint32_t a, std::uint32_t b) { return a | b; });
  }

  template <class T>
  __device__ T max(T value) {
    for (int distance = kWarp / 2; distance > 0; distance /= 2)
      value = max_(__shfl_xor_sync(kAllLanes, value, distance), value);
    return over_warps(value, [](T a, T b) { return max_(a, b); });
  }

  template <class T>
  [[nodiscard]] __device__ T* leaves() const {
    return reinterpret_cast<T*>(memory_->leaves);
  }

 private:
  static constexpr int kWarp = 32;
  static constexpr int kMostWarps = 32;
  static constexpr unsigned kAllLanes = 0xffffffffU;

  template <class T, int kCount>
  __device__ T* next_slot() {
    static_assert(std::is_trivially_copyable_v<T> && kCount * sizeof(T) <= CudaBlockMemory::kSlotBytes);
    turn_ ^= 1;
    return reinterpret_cast<T*>(memory_->slot[turn_]);
  }

  /// Joins one value per warp, equal on its lanes, into one for the block.
  template <class T, class F>
  __device__ T over_warps(T value, F&& join) {
    T* const slot = next_slot<T, kMostWarps>();
    if (threadIdx.x % kWarp == 0) slot[threadIdx.x / kWarp] = value;
    __syncthreads();
    T joined = slot[0];
    for (unsigned warp = 1; warp < blockDim.x / kWarp; ++warp) joined = join(slot[warp], joined);
    return joined;
  }

  CudaBlockMemory* memory_;
  int turn_ = 0;
};

}  // namespace stiction::inline STICTION_ISA
