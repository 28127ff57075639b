#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "core/io/guard/raw_bytes.hpp"

namespace stiction::io {

/// Sentence of a message that is shorter than its own count.
inline constexpr const char* kTruncated = "has a header message that ends too early";

/// A cursor over the bytes of one message. Reading past the end is noted, not done.
class Cursor {
 public:
  explicit Cursor(std::span<const char> bytes) : bytes_(bytes) {}
  std::uint64_t number(std::size_t width) {
    const char* here = skip(width);
    return here == nullptr ? 0 : little_endian(here, width);
  }
  const char* skip(std::size_t width) {
    if (width > bytes_.size() - at_) {
      past_end_ = true;
      at_ = bytes_.size();
      return nullptr;
    }
    at_ += width;
    return bytes_.data() + (at_ - width);
  }
  /// Skips a text and its terminating zero, then on to a multiple of `multiple` bytes from the text's beginning.
  void skip_text(std::size_t multiple) {
    std::size_t length = 0;
    while (at_ + length < bytes_.size() && bytes_[at_ + length] != '\0') ++length;
    skip((length + multiple) / multiple * multiple);
  }
  [[nodiscard]] std::size_t left() const { return bytes_.size() - at_; }
  [[nodiscard]] bool past_end() const { return past_end_; }

 private:
  std::span<const char> bytes_;
  std::size_t at_ = 0;
  bool past_end_ = false;
};

}  // namespace stiction::io
