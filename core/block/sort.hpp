#pragma once

#include <cstdint>

#include "core/block/phases.hpp"

namespace stiction::inline STICTION_ISA {

/// The first of sorted positions [begin, end) that is not before(position); end if all are.
template <class Before>
STICTION_HD Index partition_point(Index begin, Index end, const Before& before) {
  while (begin < end) {
    const Index middle = begin + (end - begin) / 2;
    if (before(middle)) {
      begin = middle + 1;
    } else {
      end = middle;
    }
  }
  return begin;
}

/// Where item i comes when the sorted run of `width` items that it is in and that run's neighbour become one: as far
/// on as there are items of the neighbour in front of it. Of equal keys the left run's come first.
template <class Key>
STICTION_HD Index merged_position(const Index* items, Index count, Offset width, Index i, const Key& key) {
  const auto up_to_count = [&](Offset position) { return static_cast<Index>(position < count ? position : count); };
  const Offset pair = i / (2 * width) * (2 * width);
  const Index begin = static_cast<Index>(pair);
  const Index middle = up_to_count(pair + width), end = up_to_count(pair + 2 * width);
  const std::uint64_t own = key(items[i]);
  if (i < middle) return i + partition_point(middle, end, [&](Index p) { return key(items[p]) < own; }) - middle;
  return i - middle + partition_point(begin, middle, [&](Index p) { return key(items[p]) <= own; });
}

/// Sorts `items` by key(item), an unsigned integer of 64 bits, ascending; items of equal keys stay in order. A merge
/// sort in which every item finds its own place, so that no lane waits for another's merge. `buffer` has room for
/// `count`.
template <Block B, class Key>
STICTION_HD_OUTLINE void stable_sort(B& block, Index* items, Index* buffer, Index count, const Key& key) {
  Index* from = items;
  Index* to = buffer;
  for (Offset width = 1; width < count; width *= 2) {
    for_each(block, count, [&](Index i) { to[merged_position(from, count, width, i, key)] = from[i]; });
    Index* const merged = to;
    to = from;
    from = merged;
  }
  if (from != items) for_each(block, count, [&](Index i) { items[i] = from[i]; });
}

/// Sorts one lane's own items, in place and without recursion (heapsort, Williams 1964).
STICTION_HD void sort_alone(Index* items, Index count) {
  const auto sift = [&](Index hole, Index end) {
    const Index item = items[hole];
    // `hole < end / 2`: it has a child; 2 * hole + 1 cannot overflow then.
    while (hole < end / 2) {
      Index child = 2 * hole + 1;
      if (child + 1 < end && items[child] < items[child + 1]) ++child;
      if (items[child] <= item) break;
      items[hole] = items[child];
      hole = child;
    }
    items[hole] = item;
  };
  for (Index hole = count / 2; hole > 0; --hole) sift(hole - 1, count);
  for (Index end = count - 1; end > 0; --end) {
    const Index largest = items[0];
    items[0] = items[end];
    items[end] = largest;
    sift(0, end);
  }
}

}  // namespace stiction::inline STICTION_ISA
