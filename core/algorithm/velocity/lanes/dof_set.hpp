#pragma once

#include <cstdint>

#include "core/base/words.hpp"

/// Sets of degrees of freedom of one environment: one word where 64 are enough, several words for a large one.
namespace stiction::inline STICTION_ISA {

using DofSet = std::uint64_t;

template <int kWords>
struct DofWords {
  std::uint64_t word[kWords];
};
/// For environments with a coupled part of more than 64.
using LargeDofSet = DofWords<8>;

/// `kMost`: most members of a set. `Small`: an integer for one of them.
template <class Set>
struct SetTraits;
template <>
struct SetTraits<DofSet> {
  static constexpr Index kMost = 64;
  static constexpr bool kIsWord = true;
  using Small = unsigned char;
};
template <int kWords>
struct SetTraits<DofWords<kWords>> {
  static constexpr Index kMost = 64 * kWords;
  static constexpr bool kIsWord = false;
  using Small = unsigned short;
};

template <int kWords>
STICTION_HD DofWords<kWords>& operator|=(DofWords<kWords>& a, const DofWords<kWords>& b) {
  for (int i = 0; i < kWords; ++i) a.word[i] |= b.word[i];
  return a;
}
template <int kWords>
STICTION_HD DofWords<kWords> operator&(DofWords<kWords> a, const DofWords<kWords>& b) {
  for (int i = 0; i < kWords; ++i) a.word[i] &= b.word[i];
  return a;
}
template <int kWords>
STICTION_HD bool operator==(const DofWords<kWords>& a, const DofWords<kWords>& b) {
  std::uint64_t unlike = 0;
  for (int i = 0; i < kWords; ++i) unlike |= a.word[i] ^ b.word[i];
  return unlike == 0;
}
/// The order of integers, as words have it.
template <int kWords>
STICTION_HD bool operator<(const DofWords<kWords>& a, const DofWords<kWords>& b) {
  for (int i = kWords - 1; i >= 0; --i)
    if (a.word[i] != b.word[i]) return a.word[i] < b.word[i];
  return false;
}

template <class Set>
STICTION_HD Set only(Index dof) {
  if constexpr (SetTraits<Set>::kIsWord) {
    return Set{1} << dof;
  } else {
    Set set{};
    set.word[dof / 64] = std::uint64_t{1} << dof % 64;
    return set;
  }
}
/// Returns the members before `dof`.
template <class Set>
STICTION_HD Set below(Index dof) {
  if constexpr (SetTraits<Set>::kIsWord) {
    return (Set{1} << dof) - 1;
  } else {
    Set set{};
    for (Index i = 0; i < dof / 64; ++i) set.word[i] = ~std::uint64_t{0};
    if (dof < SetTraits<Set>::kMost) set.word[dof / 64] = (std::uint64_t{1} << dof % 64) - 1;
    return set;
  }
}

STICTION_HD bool is_empty(DofSet set) {
  return set == 0;
}
template <int kWords>
STICTION_HD bool is_empty(const DofWords<kWords>& set) {
  return set == DofWords<kWords>{};
}
STICTION_HD Index size_of(DofSet set) {
  return bit_count(set);
}
template <int kWords>
STICTION_HD Index size_of(const DofWords<kWords>& set) {
  Index size = 0;
  for (int i = 0; i < kWords; ++i) size += bit_count(set.word[i]);
  return size;
}
/// The first and the last of a set that is not empty.
template <int kWords>
STICTION_HD Index lowest_bit(const DofWords<kWords>& set) {
  int i = 0;
  while (set.word[i] == 0) ++i;
  return 64 * i + lowest_bit(set.word[i]);
}
template <int kWords>
STICTION_HD Index highest_bit(const DofWords<kWords>& set) {
  int i = kWords - 1;
  while (set.word[i] == 0) --i;
  return 64 * i + highest_bit(set.word[i]);
}
template <class F>
STICTION_HD void for_each_dof(DofSet set, F&& f) {
  for (; set != 0; set &= set - 1) f(lowest_bit(set));
}
template <int kWords, class F>
STICTION_HD void for_each_dof(const DofWords<kWords>& set, F&& f) {
  for (int i = 0; i < kWords; ++i) for_each_dof(set.word[i], [&](Index bit) { f(64 * i + bit); });
}

/// Which of `count` numbers are not zero, the first one being `first`.
template <class Set, class Real>
STICTION_HD Set nonzero_set(const Real* numbers, Index count, Index first) {
  if constexpr (SetTraits<Set>::kIsWord) {
    return nonzero_of(numbers, count) << first;
  } else {
    Set set{};
    for (Index from = 0; from < count; from += 64) {
      const Index rest = count - from, at = first + from;
      const std::uint64_t word = nonzero_of(numbers + from, rest < 64 ? rest : 64);
      set.word[at / 64] |= word << at % 64;
      if (at % 64 != 0 && at / 64 + 1 < SetTraits<Set>::kMost / 64) set.word[at / 64 + 1] |= word >> (64 - at % 64);
    }
    return set;
  }
}
/// Degree of freedom i as count - 1 - i.
STICTION_HD DofSet mirrored(DofSet set, Index count) {
  return reversed_bits(set) >> (64 - count);
}
template <int kWords>
STICTION_HD DofWords<kWords> mirrored(const DofWords<kWords>& set, Index count) {
  DofWords<kWords> turned{};
  for_each_dof(set, [&](Index i) { turned |= only<DofWords<kWords>>(count - 1 - i); });
  return turned;
}

}  // namespace stiction::inline STICTION_ISA
