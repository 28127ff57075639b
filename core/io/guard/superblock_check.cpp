#include <cstring>

#include "core/io/guard/header_check.hpp"
#include "core/io/guard/name_heap_check.hpp"

namespace stiction::io {
namespace {

constexpr std::size_t kSignature = 8;      ///< bytes of it
constexpr std::size_t kRead = 100;         ///< bytes of a superblock that hold all that is checked
constexpr std::uint64_t kUserBlock = 512;  ///< the smallest; a file begins behind this many bytes times a power of two
constexpr unsigned kLastVersion = 3;
constexpr std::uint64_t kCachedNames = 1;  ///< kind of the root's entry

/// Positions of a superblock's fields, by its version. Extension 0: there is none.
struct Fields {
  std::size_t widths, extension, end, root;
};

Fields fields_of(unsigned version) {
  if (version == 0) return {13, 0, 40, 64};
  if (version == 1) return {13, 0, 44, 68};
  return {9, 20, 28, 36};
}

}  // namespace

std::string superblock_defect(RawBytes& bytes, std::uint64_t file_bytes) {
  char block[kRead];
  for (std::uint64_t base = 0; file_bytes >= kRead && base <= file_bytes - kRead;
       base = base == 0 ? kUserBlock : 2 * base) {
    if (!bytes.read(base, block) || std::memcmp(block, "\x89HDF\r\n\x1a\n", kSignature) != 0) continue;
    const unsigned version = static_cast<unsigned char>(block[kSignature]);
    if (version > kLastVersion) return {};
    const Fields fields = fields_of(version);
    if (block[fields.widths] != 8 || block[fields.widths + 1] != 8) {
      return "addresses in the file are not 64 bits wide, as all public files have";
    }
    if (little_endian(block + fields.end, 8) > file_bytes) return "the HDF5 file is truncated or damaged";
    if (fields.extension != 0 && little_endian(block + fields.extension, 8) != kUndefinedAddress) {
      return "the file has an extension of its superblock, which is not read";
    }
    std::string defect = header_defect(bytes, file_bytes, base, little_endian(block + fields.root, 8));
    // Before version 2 the way to the root's names may stand here once more, and HDF5 may take it.
    const char* root = block + fields.root;
    if (defect.empty() && version < 2 && little_endian(root + 8, 4) == kCachedNames) {
      defect = name_heap_defect(bytes, file_bytes, base, little_endian(root + 24, 8));
    }
    return defect.empty() ? defect : "'/' " + defect;
  }
  return {};
}

}  // namespace stiction::io
