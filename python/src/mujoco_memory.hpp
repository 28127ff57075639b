#pragma once

#include <cstddef>
#include <cstring>

namespace stiction::python {

/// The pointer that lies in a structure of MuJoCo's.
template <class T>
T* array_at(const std::byte* structure, std::size_t offset) {
  T* pointer = nullptr;
  std::memcpy(static_cast<void*>(&pointer), structure + offset, sizeof pointer);
  return pointer;
}

/// The number that does.
template <class T>
T number_at(const std::byte* structure, std::size_t offset) {
  T value{};
  std::memcpy(&value, structure + offset, sizeof value);
  return value;
}

}  // namespace stiction::python
