#include "core/io/guard/name_heap_check.hpp"

#include <cstring>

namespace stiction::io {
namespace {

constexpr std::size_t kPrefix = 32;     ///< signature, version, size of the names, first free place, their address
constexpr std::uint64_t kLastFree = 1;  ///< in place of a next free place
constexpr std::size_t kFreePlace = 16;  ///< where the next one is, and how large this one is

}  // namespace

std::string name_heap_defect(RawBytes& bytes, std::uint64_t file_bytes, std::uint64_t base, std::uint64_t address) {
  char heap[kPrefix];
  if (address > file_bytes || !bytes.read(base + address, heap) || std::memcmp(heap, "HEAP", 4) != 0) {
    return "has no readable names";
  }
  const std::uint64_t size = little_endian(heap + 8, 8), names = little_endian(heap + 24, 8);
  if (size > file_bytes || names > file_bytes - size) return "claims more names than the file holds";
  std::uint64_t left = size / kFreePlace;  // honest places do not overlap
  for (std::uint64_t place = little_endian(heap + 16, 8); place != kLastFree;) {
    char free[kFreePlace];
    if (left == 0 || size < kFreePlace || place > size - kFreePlace || !bytes.read(base + names + place, free)) {
      return "has a damaged list of free places among its names";
    }
    place = little_endian(free, 8);
    --left;
  }
  return {};
}

}  // namespace stiction::io
