#pragma once

#include <cstddef>
#include <memory>
#include <new>

#include "stiction/types.hpp"

namespace stiction::cpu {

/// Memory that grows, aligned for the widest vectors. What was in it before is lost.
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
    return static_cast<T*>(memory_.get());
  }

 private:
  static constexpr std::size_t kAlignment = 64;
  struct Free {
    void operator()(void* memory) const { ::operator delete(memory, std::align_val_t{kAlignment}); }
  };
  std::unique_ptr<void, Free> memory_;
  std::size_t capacity_ = 0;
};

/// Scratch of one worker during one solve, one piece at a time. What is small belongs to the thread and stays from
/// solve to solve. An allocator that gives it back to the system in between makes every page of it fault again.
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
