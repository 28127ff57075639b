#include "core/io/guard/inflated_size.hpp"

#include <cstddef>
#include <vector>

namespace stiction::io {
namespace {

constexpr unsigned kMaxBits = 15;  ///< of a code
constexpr unsigned kEndOfBlock = 256, kFirstLength = 257, kLengths = 29, kDistances = 30;
constexpr unsigned kLiteralCodes = 288, kCodeLengthCodes = 19;

/// Bits from the lowest of each byte on. Past the end there are zeros, which is noted.
class BitReader {
 public:
  explicit BitReader(std::span<const char> bytes) : bytes_(bytes) {}
  unsigned peek(unsigned count) {
    while (held_ < count) {
      const unsigned next = at_ < bytes_.size() ? static_cast<unsigned char>(bytes_[at_]) : 0;
      bits_ |= std::uint64_t{next} << held_;
      held_ += 8;
      ++at_;
    }
    return static_cast<unsigned>(bits_ & ((std::uint64_t{1} << count) - 1));
  }
  void drop(unsigned count) {
    bits_ >>= count;
    held_ -= count;
  }
  unsigned take(unsigned count) {
    const unsigned value = peek(count);
    drop(count);
    return value;
  }
  void skip_to_byte() { drop(held_ % 8); }
  void skip_bytes(std::size_t count) {  // at a byte, with whole bytes held
    at_ += count;
    at_ -= held_ / 8;
    bits_ = held_ = 0;
  }
  [[nodiscard]] bool past_end() const { return at_ - held_ / 8 > bytes_.size(); }

 private:
  std::span<const char> bytes_;
  std::size_t at_ = 0;
  std::uint64_t bits_ = 0;
  unsigned held_ = 0;
};

/// A Huffman code as one table: the meaning of the next bits, and their number.
class Code {
 public:
  /// `lengths`: bits of each symbol, 0: unused. False if there are more codes than bits allow.
  bool set(std::span<const unsigned char> lengths) {
    unsigned counts[kMaxBits + 1] = {}, next[kMaxBits + 2] = {};
    bits_ = 1;
    for (const unsigned length : lengths) {
      ++counts[length];
      if (length > bits_) bits_ = length;
    }
    counts[0] = 0;
    for (unsigned length = 1; length <= kMaxBits; ++length) {
      if (next[length] + counts[length] > 1U << length) return false;
      next[length + 1] = (next[length] + counts[length]) << 1;
    }
    table_.assign(std::size_t{1} << bits_, Entry{});
    for (std::size_t symbol = 0; symbol < lengths.size(); ++symbol) {
      const unsigned length = lengths[symbol];
      if (length == 0) continue;
      const unsigned code = next[length]++;
      unsigned reversed = 0;
      for (unsigned bit = 0; bit < length; ++bit) reversed |= (code >> bit & 1) << (length - 1 - bit);
      for (std::size_t at = reversed; at < table_.size(); at += std::size_t{1} << length) {
        table_[at] = {static_cast<std::uint16_t>(symbol), static_cast<std::uint8_t>(length)};
      }
    }
    return true;
  }
  /// The next symbol; kLiteralCodes if the bits are no code.
  unsigned read(BitReader& reader) const {
    const Entry entry = table_[reader.peek(bits_)];
    if (entry.length == 0) return kLiteralCodes;
    reader.drop(entry.length);
    return entry.symbol;
  }

 private:
  struct Entry {
    std::uint16_t symbol = 0;
    std::uint8_t length = 0;
  };
  std::vector<Entry> table_;
  unsigned bits_ = 1;
};

struct Codes {
  Code literals, distances;
};

bool set_fixed(Codes& codes) {
  unsigned char lengths[kLiteralCodes];
  for (unsigned i = 0; i < kLiteralCodes; ++i) {
    lengths[i] = static_cast<unsigned char>(i < 144 ? 8 : i < 256 ? 9 : i < 280 ? 7 : 8);
  }
  const std::vector<unsigned char> fives(32, 5);
  return codes.literals.set(lengths) && codes.distances.set(fives);
}

bool read_codes(BitReader& reader, Codes& codes) {
  constexpr unsigned char kOrder[kCodeLengthCodes] = {16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15};
  const unsigned literals = reader.take(5) + 257, distances = reader.take(5) + 1, used = reader.take(4) + 4;
  unsigned char order_lengths[kCodeLengthCodes] = {};
  for (unsigned i = 0; i < used; ++i) order_lengths[kOrder[i]] = static_cast<unsigned char>(reader.take(3));
  Code lengths_code;
  if (literals > 286 || !lengths_code.set(order_lengths)) return false;
  std::vector<unsigned char> lengths;
  while (lengths.size() < literals + distances) {
    const unsigned symbol = lengths_code.read(reader);
    if (symbol < 16) {
      lengths.push_back(static_cast<unsigned char>(symbol));
      continue;
    }
    if (symbol >= kCodeLengthCodes || (symbol == 16 && lengths.empty())) return false;
    const unsigned char repeated = symbol == 16 ? lengths.back() : 0;
    const unsigned times = symbol == 16 ? 3 + reader.take(2) : symbol == 17 ? 3 + reader.take(3) : 11 + reader.take(7);
    lengths.insert(lengths.end(), times, repeated);
  }
  if (lengths.size() != literals + distances || reader.past_end()) return false;
  const std::span<const unsigned char> all(lengths);
  return codes.literals.set(all.first(literals)) && codes.distances.set(all.subspan(literals));
}

/// Adds the unpacked size of one block of codes.
bool count_block(BitReader& reader, const Codes& codes, std::uint64_t limit, std::uint64_t& size) {
  constexpr unsigned short kLengthBase[kLengths] = {3,  4,  5,  6,  7,  8,  9,  10, 11,  13,  15,  17,  19,  23, 27,
                                                    31, 35, 43, 51, 59, 67, 83, 99, 115, 131, 163, 195, 227, 258};
  constexpr unsigned char kLengthBits[kLengths] = {0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2,
                                                   2, 3, 3, 3, 3, 4, 4, 4, 4, 5, 5, 5, 5, 0};
  while (size <= limit && !reader.past_end()) {
    const unsigned symbol = codes.literals.read(reader);
    if (symbol < kEndOfBlock) {
      ++size;
      continue;
    }
    if (symbol == kEndOfBlock) return true;
    const unsigned length = symbol - kFirstLength;
    if (length >= kLengths) return false;
    size += kLengthBase[length] + reader.take(kLengthBits[length]);
    const unsigned distance = codes.distances.read(reader);
    if (distance >= kDistances) return false;
    reader.take(distance < 4 ? 0 : distance / 2 - 1);
  }
  return false;
}

}  // namespace

std::optional<std::uint64_t> inflated_size(std::span<const char> stream, std::uint64_t limit) {
  BitReader reader(stream);
  constexpr unsigned kDeflate = 8, kDictionary = 0x20;
  const unsigned method = reader.take(8), flags = reader.take(8);
  if ((method & 15) != kDeflate || (flags & kDictionary) != 0) return std::nullopt;
  std::uint64_t size = 0;
  for (bool last = false; !last;) {
    last = reader.take(1) != 0;
    const unsigned kind = reader.take(2);
    Codes codes;
    if (kind == 0) {
      reader.skip_to_byte();
      const unsigned length = reader.take(16), inverse = reader.take(16);
      if ((length ^ inverse) != 0xffff) return std::nullopt;
      reader.skip_bytes(length);
      size += length;
    } else if (kind == 3 || !(kind == 1 ? set_fixed(codes) : read_codes(reader, codes)) ||
               !count_block(reader, codes, limit, size)) {
      return std::nullopt;
    }
    if (size > limit || reader.past_end()) return std::nullopt;
  }
  return size;
}

}  // namespace stiction::io
