#pragma once

#include <cstdint>

#include "core/base/macros.hpp"
#include "stiction/types.hpp"

namespace stiction::inline STICTION_ISA {

/// Columns of a row, or of rows that are worked on together, that may hold anything but zero. If none is kept (kKept =
/// false, words unused) that is every column. Which columns are left out reaches speed alone.
template <bool kKept>
struct ColumnSet {
  std::uint64_t* words;

  /// Numbers of 64 bits for so many columns.
  static STICTION_HD constexpr Offset size(Offset columns) { return kKept ? (columns + 63) / 64 : 0; }

  STICTION_HD void clear(Index columns) const {
    for (Index k = 0; k < static_cast<Index>(size(columns)); ++k) words[k] = 0;
  }
  STICTION_HD void put(Index column) const {
    if constexpr (kKept) words[column / 64] |= std::uint64_t{1} << (column % 64);
  }
  /// The members among [first, first + count), count < 64: column first + k for bit k.
  STICTION_HD void assign(Index first, Index count, std::uint64_t bits) const {
    if constexpr (kKept) {
      const std::uint64_t all = (std::uint64_t{1} << count) - 1;
      const Index shift = first % 64;
      std::uint64_t* const word = words + first / 64;
      word[0] = (word[0] & ~(all << shift)) | bits << shift;
      if (shift + count > 64) word[1] = (word[1] & ~(all >> (64 - shift))) | bits >> (64 - shift);
    }
  }
  /// The columns for which member(column) holds.
  template <class F>
  STICTION_HD void fill(Index columns, F&& member) const {
    for (Index k = 0; k < static_cast<Index>(size(columns)); ++k) {
      std::uint64_t bits = 0;
      for (Index column = k * 64; column < columns && column < k * 64 + 64; ++column)
        bits |= static_cast<std::uint64_t>(member(column)) << (column % 64);
      words[k] = bits;
    }
  }
  [[nodiscard]] STICTION_HD bool any(Index from, Index to) const {
    if constexpr (!kKept) return from < to;
    std::uint64_t found = 0;
    for (Index k = from / 64; k * 64 < to; ++k) found |= words[k] & within(k, from, to);
    return found != 0;
  }
  /// f(column) for the members in [from, to), in order.
  template <class F>
  STICTION_HD void for_each(Index from, Index to, F&& f) const {
    if constexpr (kKept) {
      for (Index k = from / 64; k * 64 < to; ++k) visit(k, words[k] & within(k, from, to), f);
    } else {
      for (Index column = from; column < to; ++column) f(column);
    }
  }
  /// f(column) for the members of both among the first `columns`, in order.
  template <class F>
  STICTION_HD void for_each_shared(const ColumnSet& other, Index columns, F&& f) const {
    if constexpr (kKept) {
      for (Index k = 0; k * 64 < columns; ++k) visit(k, words[k] & other.words[k], f);
    } else {
      for (Index column = 0; column < columns; ++column) f(column);
    }
  }

 private:
  /// The bits of word k that stand for columns in [from, to).
  static STICTION_HD std::uint64_t within(Index k, Index from, Index to) {
    const std::uint64_t all = ~std::uint64_t{0};
    const std::uint64_t above = k == from / 64 ? all << (from % 64) : all;
    return k == to / 64 ? above & ~(all << (to % 64)) : above;
  }
  template <class F>
  static STICTION_HD void visit(Index word, std::uint64_t bits, F& f) {
    for (; bits != 0; bits &= bits - 1) f(word * 64 + __builtin_ctzll(bits));
  }
};

}  // namespace stiction::inline STICTION_ISA
