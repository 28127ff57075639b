#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/io/guard/raw_bytes.hpp"

namespace stiction::io {

/// Bytes that a file stores for a string of variable length: 4 of length, 8 of the heap's address, 4 of the index in
/// it.
inline constexpr std::size_t kTextReference = 16;

/// Reads strings of variable length out of a file's global heaps (HDF5 file format specification, III.E). It does so
/// in place of HDF5, which trusts length, address and index. One flipped bit in a reference makes 1.10.8 read outside
/// of the heap, loop forever, or clear four gigabytes.
class TextHeap {
 public:
  /// `base`: where addresses count from.
  TextHeap(RawBytes& bytes, std::uint64_t file_bytes, std::uint64_t base)
      : bytes_(bytes), base_(base), heap_bytes_left_(file_bytes), text_bytes_left_(file_bytes) {}

  /// The string of a reference; nothing if the reference or its heap is damaged.
  std::optional<std::string> text(std::span<const char, kTextReference> reference);

 private:
  struct Object {
    std::size_t begin, size;
  };
  struct Collection {
    std::vector<char> bytes;
    std::map<std::uint64_t, Object> objects;
  };
  const Collection* collection(std::uint64_t address);

  RawBytes& bytes_;
  std::uint64_t base_;
  std::uint64_t heap_bytes_left_;  // honest heaps do not overlap, so together they fit the file
  std::uint64_t text_bytes_left_;  // nor do the strings in them
  std::map<std::uint64_t, Collection> collections_;
};

}  // namespace stiction::io
