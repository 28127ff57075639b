#include "core/io/guard/message_check.hpp"

#include "core/io/guard/cursor.hpp"
#include "core/io/guard/datatype_check.hpp"

namespace stiction::io {
namespace {

constexpr std::uint64_t kChunkedLayout = 2;
constexpr std::uint64_t kMaxRank = 32;
constexpr std::uint64_t kMaxFilters = 32;
constexpr std::size_t kAddress = 8;  ///< bytes of an address: files with others are refused

std::string layout_defect(std::span<const char> message, ObjectShape& shape) {
  Cursor cursor(message);
  const std::uint64_t version = cursor.number(1);
  std::uint64_t rank = 0, kind = 0, flags = 0;
  std::size_t width = 4;
  if (version == 1 || version == 2) {
    rank = cursor.number(1);
    kind = cursor.number(1);
    cursor.skip(5);
    if (kind != 0) cursor.skip(kAddress);
  } else if (version == 3 || version == 4) {
    kind = cursor.number(1);
    if (kind == 0) cursor.skip(cursor.number(2));
    if (kind == 1) cursor.skip(kAddress + 8);
    if (kind > kChunkedLayout) return "has neither a compact, contiguous nor chunked layout";
    if (kind != kChunkedLayout) return cursor.past_end() ? kTruncated : "";
    if (version == 3) {
      rank = cursor.number(1);
      cursor.skip(kAddress);
    } else {
      flags = cursor.number(1);
      rank = cursor.number(1);
      width = cursor.number(1);
      if (width < 1 || width > 8) return "has a damaged chunk size";
    }
  } else {
    return "has a layout of unknown version";
  }
  if (rank > kMaxRank + 1) return "has a damaged number of chunk dimensions";
  if (kind == kChunkedLayout) shape.chunk_rank = rank;
  for (std::uint64_t i = 0; i < rank; ++i) {
    const std::uint64_t extent = cursor.number(width);
    if (kind == kChunkedLayout && extent == 0 && !cursor.past_end()) return "has chunks of size zero";
    shape.chunk_element_bytes = extent;
  }
  if (version < 3 && kind == 0) cursor.skip(cursor.number(4));
  if (version == 4) {
    constexpr std::size_t kIndexBytes[] = {0, 0, 0, 1, 5, 6};  // kind of the index of chunks
    const std::uint64_t index = cursor.number(1);
    if (index < 1 || index > 5) return "has an unknown index of chunks";
    cursor.skip(index == 1 && (flags & 2) != 0 ? 12 : kIndexBytes[index]);
    cursor.skip(kAddress);
  }
  return cursor.past_end() ? kTruncated : "";
}

std::string dataspace_defect(std::span<const char> message, ObjectShape& shape) {
  Cursor cursor(message);
  const std::uint64_t version = cursor.number(1), rank = cursor.number(1), flags = cursor.number(1);
  cursor.skip(version == 1 ? 5 : 1);
  if (rank > kMaxRank) return "has a damaged number of dimensions";
  cursor.skip(rank * 8 * ((flags & 1) != 0 ? 2 : 1));
  shape.rank = rank;
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
  if (cursor.past_end() || name == 0) return kTruncated;
  if (name_at[name - 1] != '\0') return "has an attribute whose name does not end";
  std::string defect = datatype_defect({type_at, type});
  if (!defect.empty()) return "has an attribute that " + defect;
  ObjectShape shape;
  defect = dataspace_defect({space_at, space}, shape);
  if (!defect.empty()) return "has an attribute that " + defect;
  const std::uint64_t element = little_endian(type_at + 4, 4);
  const std::uint64_t count = element_count({space_at, space}, cursor.left());
  if (count > cursor.left() / element) return "has an attribute larger than its message";
  return {};
}

/// A size with its sign and so many bytes; not above zero: none.
void skip_sized(Cursor& cursor) {
  const std::uint64_t size = cursor.number(4);
  if (size < (std::uint64_t{1} << 31)) cursor.skip(size);
}

std::string old_fill_value_defect(std::span<const char> message) {
  Cursor cursor(message);
  skip_sized(cursor);
  return cursor.past_end() ? kTruncated : "";
}

std::string fill_value_defect(std::span<const char> message) {
  Cursor cursor(message);
  const std::uint64_t version = cursor.number(1);
  if (version < 1 || version > 3) return "has a fill value of unknown version";
  if (version == 3) {
    if ((cursor.number(1) & 0x20) != 0) cursor.skip(cursor.number(4));
  } else {
    cursor.skip(2);
    if (cursor.number(1) != 0) skip_sized(cursor);
  }
  return cursor.past_end() ? kTruncated : "";
}

std::string filters_defect(std::span<const char> message) {
  Cursor cursor(message);
  const std::uint64_t version = cursor.number(1), count = cursor.number(1);
  if (version < 1 || version > 2 || count > kMaxFilters) return "has damaged filters";
  if (version == 1) cursor.skip(6);
  constexpr std::uint64_t kNamedFrom = 256;  // in version 2 the filters that HDF5 brings along have no names
  for (std::uint64_t i = 0; i < count && !cursor.past_end(); ++i) {
    const std::uint64_t filter = cursor.number(2);
    const std::uint64_t name = version == 1 || filter >= kNamedFrom ? cursor.number(2) : 0;
    cursor.skip(2);
    const std::uint64_t values = cursor.number(2);
    const char* name_at = cursor.skip(name);
    if (name > 0 && name_at != nullptr && name_at[name - 1] != '\0') return "has a filter whose name does not end";
    cursor.skip(4 * (version == 1 ? (values + 1) / 2 * 2 : values));
  }
  return cursor.past_end() ? kTruncated : "";
}

std::string link_defect(std::span<const char> message) {
  Cursor cursor(message);
  cursor.skip(1);
  const std::uint64_t flags = cursor.number(1);
  const std::uint64_t kind = (flags & 8) != 0 ? cursor.number(1) : 0;
  if ((flags & 4) != 0) cursor.skip(8);
  if ((flags & 16) != 0) cursor.skip(1);
  const std::uint64_t name = cursor.number(std::size_t{1} << (flags & 3));
  if (name > cursor.left()) return kTruncated;
  cursor.skip(name);
  if (kind == 0) {
    cursor.skip(kAddress);
  } else {
    cursor.skip(cursor.number(2));
  }
  return cursor.past_end() ? kTruncated : "";
}

/// Attributes in a separate heap are decoded from there, where nothing was checked.
std::string attribute_info_defect(std::span<const char> message) {
  Cursor cursor(message);
  cursor.skip(1);
  const std::uint64_t flags = cursor.number(1);
  if ((flags & 1) != 0) cursor.skip(2);
  const std::uint64_t heap = cursor.number(kAddress);
  cursor.skip((flags & 2) != 0 ? 2 * kAddress : kAddress);
  if (cursor.past_end()) return kTruncated;
  return heap == kUndefinedAddress ? "" : "has more attributes than lie in its header";
}

/// Messages without anything of variable length: they need so many bytes.
std::string size_defect(std::span<const char> message, std::size_t bytes) {
  return message.size() < bytes ? kTruncated : "";
}

}  // namespace

std::string message_defect(MessageKind kind, std::span<const char> message, ObjectShape& shape) {
  std::string defect;
  switch (kind) {
    case MessageKind::dataspace:
      return dataspace_defect(message, shape);
    case MessageKind::datatype:
      defect = datatype_defect(message);
      if (defect.empty()) shape.element_bytes = little_endian(message.data() + 4, 4);
      return defect;
    case MessageKind::layout:
      return layout_defect(message, shape);
    case MessageKind::attribute:
      return attribute_defect(message);
    case MessageKind::old_fill_value:
      return old_fill_value_defect(message);
    case MessageKind::fill_value:
      return fill_value_defect(message);
    case MessageKind::filters:
      return filters_defect(message);
    case MessageKind::link:
      return link_defect(message);
    case MessageKind::external_files:
      return "keeps its data in another file";
    case MessageKind::attribute_info:
      return attribute_info_defect(message);
    case MessageKind::link_info: {
      const unsigned flags = message.size() < 2 ? 0 : static_cast<unsigned char>(message[1]);
      return size_defect(message, 2 + 2 * kAddress + ((flags & 1) != 0 ? 8 : 0) + ((flags & 2) != 0 ? kAddress : 0));
    }
    case MessageKind::group_info: {
      const unsigned flags = message.size() < 2 ? 0 : static_cast<unsigned char>(message[1]);
      return size_defect(message, 2 + ((flags & 1) != 0 ? 4U : 0U) + ((flags & 2) != 0 ? 4U : 0U));
    }
    case MessageKind::continuation:
    case MessageKind::symbol_table:
    case MessageKind::old_time:
      return size_defect(message, 16);
    case MessageKind::time:
      return size_defect(message, 8);
    case MessageKind::reference_count:
      return size_defect(message, 5);
  }
  return {};
}

bool is_single_message(MessageKind kind) {
  switch (kind) {
    case MessageKind::dataspace:
    case MessageKind::datatype:
    case MessageKind::layout:
    case MessageKind::filters:
    case MessageKind::symbol_table:
    case MessageKind::link_info:
    case MessageKind::attribute_info:
      return true;
    default:
      return false;
  }
}

}  // namespace stiction::io
