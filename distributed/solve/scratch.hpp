#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "stiction/types.hpp"

namespace stiction::distributed {

/// Memory that begins on a cache line.
template <class T>
class Scratch {
 public:
  explicit Scratch(Offset count) : numbers_(static_cast<std::size_t>(count) + 64 / sizeof(T)) {}
  T* data() {
    void* begin = numbers_.data();
    std::size_t space = numbers_.size() * sizeof(T);
    return static_cast<T*>(std::align(64, 1, begin, space));
  }

 private:
  std::vector<T> numbers_;
};

}  // namespace stiction::distributed
