#include "core/io/header_check.hpp"

#include <cstring>
#include <deque>
#include <optional>
#include <span>
#include <vector>

namespace stiction::io {
namespace {

// Message types.
constexpr unsigned kDataspace = 0x01;
constexpr unsigned kLayout = 0x08;
constexpr unsigned kAttribute = 0x0c;
constexpr unsigned kContinuation = 0x10;
constexpr unsigned kSymbolTable = 0x11;

constexpr unsigned kSharedMessage = 2;  // flag: the message lies elsewhere
constexpr std::uint64_t kChunkedLayout = 2;
constexpr std::uint64_t kMaxRank = 32;

constexpr const char* kTruncated = "has a header message that ends too early";

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
  [[nodiscard]] std::size_t left() const { return bytes_.size() - at_; }
  [[nodiscard]] bool past_end() const { return past_end_; }

 private:
  std::span<const char> bytes_;
  std::size_t at_ = 0;
  bool past_end_ = false;
};

/// `chunk_rank` becomes the number of chunk dimensions, the element's bytes among them.
std::string layout_defect(std::span<const char> message, std::optional<std::uint64_t>& chunk_rank) {
  Cursor cursor(message);
  const std::uint64_t version = cursor.number(1);
  std::uint64_t rank = 0, kind = 0;
  std::size_t width = 4;
  if (version == 1 || version == 2) {
    rank = cursor.number(1);
    kind = cursor.number(1);
    cursor.skip(5);
    if (kind != 0) cursor.skip(8);
  } else if (version == 3) {
    kind = cursor.number(1);
    if (kind != kChunkedLayout) return {};
    rank = cursor.number(1);
    cursor.skip(8);
  } else if (version == 4) {
    kind = cursor.number(1);
    if (kind != kChunkedLayout) return {};
    cursor.skip(1);
    rank = cursor.number(1);
    width = cursor.number(1);
    if (width < 1 || width > 8) return "has a damaged chunk size";
  } else {
    return {};
  }
  if (rank > kMaxRank + 1) return "has a damaged number of chunk dimensions";
  if (kind == kChunkedLayout) chunk_rank = rank;
  for (std::uint64_t i = 0; i < rank && kind == kChunkedLayout; ++i) {
    if (cursor.number(width) == 0 && !cursor.past_end()) return "has chunks of size zero";
  }
  return cursor.past_end() ? kTruncated : "";
}

/// Number of elements of a dataspace message; at most `limit` + 1.
std::uint64_t element_count(std::span<const char> message, std::uint64_t limit) {
  Cursor cursor(message);
  const std::uint64_t version = cursor.number(1), rank = cursor.number(1);
  cursor.skip(1);
  if (version == 1) {
    cursor.skip(5);
  } else if (cursor.number(1) == 2) {  // the null dataspace
    return 0;
  }
  std::uint64_t count = 1;
  for (std::uint64_t i = 0; i < rank && i < kMaxRank; ++i) {
    const std::uint64_t extent = cursor.number(8);
    if (extent != 0 && count > limit / extent) return limit + 1;
    count *= extent;
  }
  return count;
}

std::string attribute_defect(std::span<const char> message) {
  Cursor cursor(message);
  const std::uint64_t version = cursor.number(1);
  if (version < 1 || version > 3) return "has an attribute of unknown version";
  const std::uint64_t flags = cursor.number(1);
  std::size_t name = cursor.number(2), type = cursor.number(2), space = cursor.number(2);
  if (version == 3) cursor.skip(1);
  if (version > 1 && flags != 0) return "has an attribute whose type is stored elsewhere";
  const auto padded = [version](std::size_t size) { return version == 1 ? (size + 7) / 8 * 8 : size; };
  const char* name_at = cursor.skip(padded(name));
  const char* type_at = cursor.skip(padded(type));
  const char* space_at = cursor.skip(padded(space));
  if (cursor.past_end() || name == 0 || type < 8 || space < 4) return kTruncated;
  if (name_at[name - 1] != '\0') return "has an attribute whose name does not end";
  const std::uint64_t element = little_endian(type_at + 4, 4);
  const std::uint64_t count = element_count({space_at, space}, cursor.left());
  if (element != 0 && count > cursor.left() / element) return "has an attribute larger than its message";
  return {};
}

/// The heap of a group's names: HDF5 adds to the size it claims before it asks for memory, and wraps around.
std::string symbol_table_defect(RawBytes& bytes, std::uint64_t file_bytes, std::uint64_t base,
                                std::span<const char> message) {
  if (message.size() < 16) return kTruncated;
  const std::uint64_t address = little_endian(message.data() + 8, 8);
  char heap[16];
  if (address > file_bytes || !bytes.read(base + address, heap) || std::memcmp(heap, "HEAP", 4) != 0) {
    return "has no readable names";
  }
  return little_endian(heap + 8, 8) > file_bytes ? "claims more names than the file holds" : "";
}

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
  std::optional<std::uint64_t> rank;
  std::optional<std::uint64_t> chunk_rank;
  for (; !blocks.empty(); blocks.pop_front()) {
    const Block block = blocks.front();
    if (block.size > left) return "has a header larger than the file";
    left -= block.size;
    std::vector<char> content(block.size);
    if (!bytes.read(block.address, content)) return "has a header that ends after the file";
    Cursor cursor(content);
    while (cursor.left() >= prefix.message_header) {
      const std::uint64_t type = cursor.number(prefix.second_version ? 1 : 2), size = cursor.number(2);
      const std::uint64_t flags = cursor.number(1);
      cursor.skip(prefix.message_header - (prefix.second_version ? 4 : 5));
      const char* body = cursor.skip(size);
      if (body == nullptr) return kTruncated;
      if (type == kContinuation && size >= 16) {
        Block next{base + little_endian(body, 8), little_endian(body + 8, 8)};
        if (prefix.second_version) {  // "OCHK" before, a checksum after
          next.address += 4;
          next.size = next.size < 8 ? 0 : next.size - 8;
        }
        blocks.push_back(next);
      }
      const std::span<const char> message(body, size);
      std::string defect;
      if (type == kDataspace && size >= 2) rank = little_endian(body + 1, 1);
      if (type == kLayout) defect = layout_defect(message, chunk_rank);
      if (type == kAttribute) defect = attribute_defect(message);
      if (type == kSymbolTable) defect = symbol_table_defect(bytes, file_bytes, base, message);
      if ((type == kDataspace || type == kLayout || type == kAttribute) && (flags & kSharedMessage) != 0) {
        defect = "has a header message that is stored elsewhere";
      }
      if (!defect.empty()) return defect;
    }
  }
  if (chunk_rank && rank.value_or(0) + 1 != *chunk_rank) return "has chunks of another rank than its shape";
  return {};
}

}  // namespace stiction::io
