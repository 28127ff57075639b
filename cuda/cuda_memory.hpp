#pragma once

#include <cuda_runtime_api.h>

#include <cstddef>
#include <utility>

namespace stiction::cuda {

/// Device memory in the order of streams. A pool of its own, so that memory stays with the solver from one solve to the
/// next and the process's other users of CUDA are left alone; plain cudaMalloc where the device has no pools.
class MemoryPool {
 public:
  explicit MemoryPool(int ordinal);
  ~MemoryPool();
  MemoryPool(const MemoryPool&) = delete;
  MemoryPool& operator=(const MemoryPool&) = delete;

  /// \throws Error(out_of_memory).
  void* allocate(std::size_t bytes, cudaStream_t stream);
  /// What was queued on `stream` so far may still use it.
  void free(void* memory, cudaStream_t stream) noexcept;

 private:
  cudaMemPool_t pool_ = nullptr;
};

/// Owner of device memory that is given back in the order of one stream.
class DeviceBuffer {
 public:
  DeviceBuffer() = default;
  DeviceBuffer(MemoryPool& pool, std::size_t bytes, cudaStream_t stream)
      : pool_(&pool), stream_(stream), memory_(bytes == 0 ? nullptr : pool.allocate(bytes, stream)) {}
  ~DeviceBuffer() {
    if (memory_ != nullptr) pool_->free(memory_, stream_);
  }
  DeviceBuffer(DeviceBuffer&& other) noexcept
      : pool_(other.pool_), stream_(other.stream_), memory_(std::exchange(other.memory_, nullptr)) {}
  DeviceBuffer& operator=(DeviceBuffer&& other) noexcept {
    std::swap(pool_, other.pool_);
    std::swap(stream_, other.stream_);
    std::swap(memory_, other.memory_);
    return *this;
  }
  [[nodiscard]] std::byte* get() const noexcept { return static_cast<std::byte*>(memory_); }

 private:
  MemoryPool* pool_ = nullptr;
  cudaStream_t stream_ = nullptr;
  void* memory_ = nullptr;
};

}  // namespace stiction::cuda
