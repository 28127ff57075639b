#pragma once

#include "core/team/phases.hpp"

namespace stiction::inline STICTION_ISA {

/// Integers of scratch that count_sort() needs.
STICTION_HD constexpr Offset count_sort_scratch(Index lanes, int keys) {
  return Offset{lanes} * keys;
}

/// Stable counting sort. order[0 .. count) becomes the items 0 .. count-1 by key(item), equal keys by item.
/// key_begin[k], k = 0 .. keys, is the place where key k begins. Each lane counts and then places a run of
/// neighbouring items, so the order is that of the keys and items alone.
template <Team TeamT, class Key>
STICTION_HD void count_sort(TeamT& team, Offset count, int keys, Key&& key, Offset* order, Offset* key_begin,
                            Offset* scratch) {
  const Offset lanes = team.size();
  const Offset run = (count + lanes - 1) / lanes;
  const Offset first = team.rank() * run;
  const Offset last = first + run < count ? first + run : count;
  const auto counter = [&](int k, Offset lane) -> Offset& { return scratch[k * lanes + lane]; };
  for (int k = 0; k < keys; ++k) counter(k, team.rank()) = 0;
  for (Offset item = first; item < last; ++item) ++counter(key(item), team.rank());
  team.sync();
  for_each(team, keys, [&](Index k) {
    Offset sum = 0;
    for (Offset lane = 0; lane < lanes; ++lane) sum += counter(k, lane);
    key_begin[k + 1] = sum;
  });
  single(team, [&] {
    key_begin[0] = 0;
    for (int k = 0; k < keys; ++k) key_begin[k + 1] += key_begin[k];
  });
  for_each(team, keys, [&](Index k) {
    Offset next = key_begin[k];
    for (Offset lane = 0; lane < lanes; ++lane) {
      const Offset own = counter(k, lane);
      counter(k, lane) = next;
      next += own;
    }
  });
  for (Offset item = first; item < last; ++item) order[counter(key(item), team.rank())++] = item;
  team.sync();
}

}  // namespace stiction::inline STICTION_ISA
