#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace stiction {

/// f(first environment, one past the last) for each run of environments in a mask.
template <class F>
void for_each_run(std::span<const std::uint8_t> mask, F&& f) {
  std::size_t begin = 0;
  while (begin < mask.size()) {
    std::size_t end = begin;
    while (end < mask.size() && mask[end] != 0) ++end;
    if (end > begin) f(begin, end);
    begin = end + 1;
  }
}

}  // namespace stiction
