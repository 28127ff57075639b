#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

namespace stiction::io {

/// Types of header messages.
enum class MessageKind : std::uint16_t {
  dataspace = 0x01,
  link_info = 0x02,
  datatype = 0x03,
  old_fill_value = 0x04,
  fill_value = 0x05,
  link = 0x06,
  external_files = 0x07,
  layout = 0x08,
  group_info = 0x0a,
  filters = 0x0b,
  attribute = 0x0c,
  old_time = 0x0e,
  continuation = 0x10,
  symbol_table = 0x11,
  time = 0x12,
  attribute_info = 0x15,
  reference_count = 0x16,
};

/// Facts about an object after a check of all its messages: those that must fit one another.
struct ObjectShape {
  std::optional<std::uint64_t> rank;           ///< of the dataspace
  std::optional<std::uint64_t> element_bytes;  ///< of the datatype
  std::optional<std::uint64_t> chunk_rank;     ///< number of chunk dimensions, including the element's bytes
  std::uint64_t chunk_element_bytes = 0;       ///< the last of them
};

/// Searches one message (file format specification, IV.A.2) for data that HDF5 1.10.8 takes on trust. It decodes most
/// kinds without regard to where the message ends. Kinds that are not listed above are not decoded when arrays are
/// read. Returns the defect, or nothing.
std::string message_defect(MessageKind kind, std::span<const char> message, ObjectShape& shape);

/// True if every object has at most one message of this kind: HDF5 takes the first, and a second was not checked.
bool is_single_message(MessageKind kind);

}  // namespace stiction::io
