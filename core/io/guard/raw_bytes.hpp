#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <span>

namespace stiction::io {

/// HDF5's address of a missing object.
inline constexpr std::uint64_t kUndefinedAddress = UINT64_MAX;

/// The bytes of a file, at any place.
class RawBytes {
 public:
  RawBytes() = default;
  explicit RawBytes(const std::filesystem::path& path) : stream_(path, std::ios::binary) {}
  explicit RawBytes(std::span<const std::byte> image) : image_(image) {}
  /// Fills `out` from `offset` on; false if the file ends before.
  bool read(std::uint64_t offset, std::span<char> out);

 private:
  std::ifstream stream_;
  std::span<const std::byte> image_;
};

/// An unsigned number of 1 to 8 bytes as HDF5 stores it.
std::uint64_t little_endian(const char* bytes, std::size_t width);

}  // namespace stiction::io
