#include "core/io/guard/header_check.hpp"

#include <cstring>
#include <deque>
#include <set>
#include <span>
#include <vector>

#include "core/io/guard/cursor.hpp"
#include "core/io/guard/message_check.hpp"
#include "core/io/guard/name_heap_check.hpp"

namespace stiction::io {
namespace {

constexpr unsigned kSharedMessage = 2;  // flag: the message lies elsewhere

struct Block {
  std::uint64_t address, size;
};

/// The fixed parts of a header, and where its messages begin.
struct Prefix {
  Block first{};
  bool second_version = false;
  std::size_t message_header = 8;
};

bool read_prefix(RawBytes& bytes, std::uint64_t at, Prefix& prefix) {
  char head[16];
  if (!bytes.read(at, head)) return false;
  if (std::memcmp(head, "OHDR", 4) != 0) {
    prefix.first = {at + sizeof head, little_endian(head + 8, 4)};
    return head[0] == 1;
  }
  prefix.second_version = true;
  const unsigned flags = static_cast<unsigned char>(head[5]);
  const std::uint64_t optional = ((flags & 0x20) != 0 ? 16U : 0U) + ((flags & 0x10) != 0 ? 4U : 0U);
  const std::size_t width = std::size_t{1} << (flags & 3);
  char size[8];
  if (!bytes.read(at + 6 + optional, std::span(size, width))) return false;
  prefix.first = {at + 6 + optional + width, little_endian(size, width)};
  prefix.message_header = (flags & 4) != 0 ? 6 : 4;
  return true;
}

}  // namespace

std::string header_defect(RawBytes& bytes, std::uint64_t file_bytes, std::uint64_t base, std::uint64_t address) {
  Prefix prefix;
  if (address > file_bytes || !read_prefix(bytes, base + address, prefix)) return "has no readable header";
  std::deque<Block> blocks{prefix.first};
  std::uint64_t left = file_bytes;  // honest blocks do not overlap
  ObjectShape shape;
  std::set<MessageKind> seen;
  for (; !blocks.empty(); blocks.pop_front()) {
    const Block block = blocks.front();
    if (block.size > left) return "has a header larger than the file";
    left -= block.size;
    std::vector<char> content(block.size);
    if (!bytes.read(block.address, content)) return "has a header that ends after the file";
    Cursor cursor(content);
    if (block.size > 0 && block.size < prefix.message_header) return kTruncated;
    while (cursor.left() >= prefix.message_header) {
      const auto kind = static_cast<MessageKind>(cursor.number(prefix.second_version ? 1 : 2));
      const std::uint64_t size = cursor.number(2), flags = cursor.number(1);
      cursor.skip(prefix.message_header - (prefix.second_version ? 4 : 5));
      const char* body = cursor.skip(size);
      if (body == nullptr) return kTruncated;
      if ((flags & kSharedMessage) != 0) return "has a header message that is stored elsewhere";
      if (is_single_message(kind) && !seen.insert(kind).second) return "has two header messages of one kind";
      const std::span<const char> message(body, size);
      std::string defect = message_defect(kind, message, shape);
      if (defect.empty() && kind == MessageKind::symbol_table) {
        defect = name_heap_defect(bytes, file_bytes, base, little_endian(body + 8, 8));
      }
      if (!defect.empty()) return defect;
      if (kind == MessageKind::continuation) {
        Block next{base + little_endian(body, 8), little_endian(body + 8, 8)};
        if (prefix.second_version) {  // "OCHK" before, a checksum after
          next.address += 4;
          next.size = next.size < 8 ? 0 : next.size - 8;
        }
        blocks.push_back(next);
      }
    }
  }
  if (!shape.chunk_rank) return {};
  if (shape.rank.value_or(0) + 1 != *shape.chunk_rank) return "has chunks of another rank than its shape";
  if (shape.element_bytes != shape.chunk_element_bytes) return "has chunks of another type than its elements";
  return {};
}

}  // namespace stiction::io
