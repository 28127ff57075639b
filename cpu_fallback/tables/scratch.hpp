#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <new>

#include "stiction/types.hpp"

#ifdef STICTION_UNDEFINED_SCRATCH
#include <valgrind/memcheck.h>
#endif

namespace stiction::cpu {

/// Memory that grows, aligned for the widest vectors. Its earlier contents are lost.
class GrowBuffer {
 public:
  template <class T>
  T* reserve(Offset elements) {
    const std::size_t bytes = static_cast<std::size_t>(elements) * sizeof(T);
    if (bytes > capacity_) {
      memory_.reset();
      capacity_ = 0;
      memory_.reset(::operator new(bytes, std::align_val_t{kAlignment}));
      capacity_ = bytes;
    }
#ifdef STICTION_NOISY_SCRATCH
    make_noise(bytes);
#endif
#ifdef STICTION_UNDEFINED_SCRATCH
    (void)VALGRIND_MAKE_MEM_UNDEFINED(memory_.get(), capacity_);  // reads of what a solve has not written are reported
#endif
    return static_cast<T*>(memory_.get());
  }

 private:
  static constexpr std::size_t kAlignment = 64;
#ifdef STICTION_NOISY_SCRATCH
  /// Numbers that differ every time: memory read before it is written shows as different bits of equal solves.
  void make_noise(std::size_t bytes) {
    static std::atomic<std::uint64_t> state{1};
    auto* const memory = static_cast<unsigned char*>(memory_.get());
    std::uint64_t own = state.fetch_add(0x9e3779b97f4a7c15U);
    for (std::size_t i = 0; i + sizeof(own) <= bytes; i += sizeof(own)) {
      own ^= own << 13U;
      own ^= own >> 7U;
      own ^= own << 17U;
      // A size with which sums of a few thousand stay finite, in either precision.
      const std::uint64_t number = (own & 0x8fffffff8fffffffU) | 0x3000000030000000U;
      std::memcpy(memory + i, &number, sizeof(number));
    }
  }
#endif
  struct Free {
    void operator()(void* memory) const { ::operator delete(memory, std::align_val_t{kAlignment}); }
  };
  std::unique_ptr<void, Free> memory_;
  std::size_t capacity_ = 0;
};

/// Scratch of one worker during one solve, one piece at a time. Small buffers belong to the thread and stay from solve
/// to solve. An allocator that gives it back to the system in between makes every page of it fault again.
class Scratch {
 public:
  template <class T>
  T* reserve(Offset elements) {
    const bool is_small = static_cast<std::size_t>(elements) * sizeof(T) <= kMostKept;
    return (is_small ? kept() : large_).reserve<T>(elements);
  }

 private:
  static constexpr std::size_t kMostKept = std::size_t{1} << 20;
  static GrowBuffer& kept() {
    thread_local GrowBuffer buffer;
    return buffer;
  }
  GrowBuffer large_;
};

}  // namespace stiction::cpu
