#pragma once

#include <vector>

#include "cuda/cuda_check.hpp"
#include "cuda/cuda_memory.hpp"

namespace stiction::cuda {

/// Several arrays in one allocation: say what is wanted, allocate once, and each pointer is set.
class ArraySet {
 public:
  /// Room for `count` elements behind `target`, filled from `source` unless that is null. Both must outlive allocate().
  template <class T>
  void add(const T*& target, const T* source, Offset count) {
    entries_.push_back({&target, source, bytes_of<T>(count), [](void* where, std::byte* memory) {
                          *static_cast<const T**>(where) = reinterpret_cast<const T*>(memory);
                        }});
  }
  template <class T>
  void add(T*& target, Offset count) {
    entries_.push_back({&target, nullptr, bytes_of<T>(count), [](void* where, std::byte* memory) {
                          *static_cast<T**>(where) = reinterpret_cast<T*>(memory);
                        }});
  }

  /// One allocation and the copies, in the order of `stream`.
  DeviceBuffer allocate(MemoryPool& pool, cudaStream_t stream) const {
    std::size_t total = 0;
    for (const Entry& entry : entries_) total += padded(entry.bytes);
    DeviceBuffer buffer(pool, total, stream);
    std::size_t position = 0;
    for (const Entry& entry : entries_) {
      entry.assign(entry.target, buffer.get() + position);
      if (entry.source != nullptr && entry.bytes > 0)
        STICTION_CUDA_TRY(
            cudaMemcpyAsync(buffer.get() + position, entry.source, entry.bytes, cudaMemcpyHostToDevice, stream));
      position += padded(entry.bytes);
    }
    return buffer;
  }

 private:
  struct Entry {
    void* target;
    const void* source;
    std::size_t bytes;
    void (*assign)(void* where, std::byte* memory);
  };
  static constexpr std::size_t kAlignment = 256;
  template <class T>
  static std::size_t bytes_of(Offset count) {
    return static_cast<std::size_t>(count) * sizeof(T);
  }
  static std::size_t padded(std::size_t bytes) { return (bytes + kAlignment - 1) / kAlignment * kAlignment; }

  std::vector<Entry> entries_;
};

}  // namespace stiction::cuda
