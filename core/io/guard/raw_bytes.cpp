#include "core/io/guard/raw_bytes.hpp"

#include <cstring>

namespace stiction::io {

bool RawBytes::read(std::uint64_t offset, std::span<char> out) {
  if (!image_.empty()) {
    if (offset > image_.size() || out.size() > image_.size() - offset) return false;
    if (!out.empty()) std::memcpy(out.data(), image_.data() + offset, out.size());
    return true;
  }
  stream_.clear();
  stream_.seekg(static_cast<std::streamoff>(offset));
  stream_.read(out.data(), static_cast<std::streamsize>(out.size()));
  return stream_.good();
}

std::uint64_t little_endian(const char* bytes, std::size_t width) {
  std::uint64_t value = 0;
  for (std::size_t i = width; i-- > 0;) value = (value << 8) | static_cast<unsigned char>(bytes[i]);
  return value;
}

}  // namespace stiction::io
