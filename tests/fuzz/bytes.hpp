#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

namespace stiction::fuzz {

/// The bytes that libFuzzer hands over, taken from the front. When they are used up, zeros follow.
class Bytes {
 public:
  Bytes(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}
  [[nodiscard]] bool empty() const { return size_ == 0; }
  std::uint8_t byte() {
    if (size_ == 0) return 0;
    --size_;
    return *data_++;
  }
  /// A number in 0 .. count - 1; count <= 256.
  int below(int count) { return byte() % count; }
  /// true once in `count` bytes.
  bool once_in(int count) { return byte() % count == 1; }
  template <class T>
  T raw() {
    std::uint8_t bytes[sizeof(T)];
    for (std::uint8_t& one : bytes) one = byte();
    T value;
    std::memcpy(&value, bytes, sizeof value);
    return value;
  }
  template <class T, std::size_t kCount>
  T one_of(const T (&choices)[kCount]) {
    return choices[byte() % kCount];
  }

 private:
  const std::uint8_t* data_;
  std::size_t size_;
};

}  // namespace stiction::fuzz
