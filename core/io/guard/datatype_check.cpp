#include "core/io/guard/datatype_check.hpp"

#include "core/io/guard/cursor.hpp"
#include "core/io/guard/text_heap.hpp"

namespace stiction::io {
namespace {

// Classes, and the versions of the message that have one layout for them.
constexpr unsigned kInteger = 0, kFloat = 1, kText = 3, kEnumerator = 8, kVariableLength = 9;
constexpr unsigned kFirstVersion = 1, kLastVersion = 5, kUnpaddedNames = 3;
constexpr std::uint64_t kVariableText = 1;  ///< kind of a type of variable length

constexpr const char* kDamaged = "has a damaged number type";

/// Head of every datatype.
struct Head {
  unsigned version = 0, type_class = 0;
  std::uint64_t bits = 0;  ///< 24, whose meaning the class decides
  std::uint64_t size = 0;  ///< of an element [bytes]
};

Head read_head(Cursor& cursor) {
  const auto first = static_cast<unsigned>(cursor.number(1));
  Head head{first >> 4, first & 15, 0, 0};
  head.bits = cursor.number(3);
  head.size = cursor.number(4);
  return head;
}

bool known_version(const Head& head) {
  return head.version >= kFirstVersion && head.version <= kLastVersion;
}

/// Integers and floating-point numbers: their bits must lie inside of their bytes.
std::string number_defect(Cursor& cursor, const Head& head) {
  const std::uint64_t offset = cursor.number(2), precision = cursor.number(2);
  if (offset + precision > 8 * head.size || precision == 0) return kDamaged;
  if (head.type_class == kInteger) return {};
  const std::uint64_t exponent_at = cursor.number(1), exponent = cursor.number(1);
  const std::uint64_t mantissa_at = cursor.number(1), mantissa = cursor.number(1);
  cursor.skip(4);  // the exponent's bias
  const std::uint64_t sign_at = head.bits >> 8;
  if (exponent == 0 || mantissa == 0 || exponent_at + exponent > precision || mantissa_at + mantissa > precision ||
      sign_at >= precision) {
    return kDamaged;
  }
  return {};
}

/// Names and values follow the integer that they stand for.
std::string enumerator_defect(Cursor& cursor, const Head& head) {
  const Head base = read_head(cursor);
  if (!known_version(base) || base.type_class != kInteger || base.size != head.size) return kDamaged;
  std::string defect = number_defect(cursor, base);
  if (!defect.empty()) return defect;
  const std::uint64_t count = head.bits & 0xffff;
  if (count == 0) return kDamaged;
  for (std::uint64_t i = 0; i < count && !cursor.past_end(); ++i) {
    cursor.skip_text(head.version >= kUnpaddedNames ? 1 : 8);
  }
  if (base.size > cursor.left() / count) return kTruncated;
  cursor.skip(base.size * count);
  return {};
}

/// A string of variable length is a sequence of single bytes, called integers or strings. The file stores a length, an
/// address and an index for it; HDF5 copies as much whatever the stated size.
std::string variable_text_defect(Cursor& cursor, const Head& head) {
  const Head base = read_head(cursor);
  if ((head.bits & 15) != kVariableText) return "has a type of variable length that is no string";
  if (!known_version(base) || base.size != 1 || head.size != kTextReference) return "has a damaged string type";
  if (base.type_class == kText) return {};
  return base.type_class == kInteger ? number_defect(cursor, base) : "has a damaged string type";
}

/// Returns the name of one of the other classes.
const char* name_of(unsigned type_class) {
  constexpr const char* kNames[] = {
      nullptr,      nullptr, "times", nullptr, "bit fields", "opaque bytes", "compound records",
      "references", nullptr, nullptr, "arrays"};
  constexpr unsigned kKnown = sizeof kNames / sizeof *kNames;
  return type_class < kKnown && kNames[type_class] != nullptr ? kNames[type_class] : "an unknown type";
}

}  // namespace

std::string datatype_defect(std::span<const char> message) {
  Cursor cursor(message);
  const Head head = read_head(cursor);
  if (cursor.past_end()) return kTruncated;
  if (!known_version(head)) return "has a type of unknown version";
  if (head.size == 0) return "has a type of no bytes";
  std::string defect;
  if (head.type_class == kInteger || head.type_class == kFloat) {
    defect = number_defect(cursor, head);
  } else if (head.type_class == kEnumerator) {
    defect = enumerator_defect(cursor, head);
  } else if (head.type_class == kVariableLength) {
    defect = variable_text_defect(cursor, head);
  } else if (head.type_class != kText) {
    return std::string("holds ") + name_of(head.type_class) + ", expected numbers or strings";
  }
  return cursor.past_end() ? kTruncated : defect;
}

}  // namespace stiction::io
