#pragma once

#include "core/team/phases.hpp"

namespace stiction::inline STICTION_ISA {

/// Lanes whose counters are added up one after the other. Sums of such groups are added in a second step, so that no
/// lane walks through the counters of all.
inline constexpr Index kSortGroup = 16;

/// Groups of so many lanes.
STICTION_HD constexpr Index sort_groups(Index lanes) {
  return (lanes + kSortGroup - 1) / kSortGroup;
}

/// Integers of scratch that count_sort() needs.
STICTION_HD constexpr Offset count_sort_scratch(Index lanes, int keys) {
  return Offset{keys} * (lanes + sort_groups(lanes) + 1) + 1;
}

/// Stable counting sort of fewer than 2^31 items. order[0 .. count) becomes the items 0 .. count-1 by key(item), equal
/// keys by item. key_begin[k], k = 0 .. keys, is the place where key k begins. Each lane counts and then places a run
/// of neighbouring items, so the order is that of the keys and items alone. `scratch` is best in fast memory: counting,
/// summing and placing wait for it.
template <Team TeamT, class Key>
STICTION_HD void count_sort(TeamT& team, Offset count, int keys, Key&& key, Offset* order, Offset* key_begin,
                            Index* scratch) {
  const Index lanes = team.size(), groups = sort_groups(lanes), own_group = team.rank() / kSortGroup;
  const Offset run = (count + lanes - 1) / lanes;
  const Offset first = team.rank() * run;
  const Offset last = first + run < count ? first + run : count;
  Index* const group_sums = scratch + Offset{keys} * lanes;
  Index* const begins = group_sums + Offset{keys} * groups;
  const auto counter = [=](int k, Index lane) -> Index& { return scratch[Offset{k} * lanes + lane]; };
  const auto group_sum = [=](int k, Index group) -> Index& { return group_sums[Offset{k} * groups + group]; };
  for (int k = 0; k < keys; ++k) counter(k, team.rank()) = 0;
  for (Offset item = first; item < last; ++item) ++counter(key(item), team.rank());
  team.sync();
  // Counters become the numbers of items that lanes of the same group before have, sums those of groups before.
  for_each(team, keys * groups, [=](Index pair) {
    const int k = pair / groups;
    const Index group = pair % groups;
    const Index end = group + 1 < groups ? (group + 1) * kSortGroup : lanes;
    Index before = 0;
    for (Index lane = group * kSortGroup; lane < end; ++lane) {
      const Index own = counter(k, lane);
      counter(k, lane) = before;
      before += own;
    }
    group_sum(k, group) = before;
  });
  for_each(team, keys, [=](Index k) {
    Index before = 0;
    for (Index group = 0; group < groups; ++group) {
      const Index own = group_sum(k, group);
      group_sum(k, group) = before;
      before += own;
    }
    begins[k + 1] = before;
  });
  single(team, [=] {
    begins[0] = 0;
    for (int k = 0; k < keys; ++k) begins[k + 1] += begins[k];
  });
  for_each(team, keys + 1, [=](Index k) { key_begin[k] = begins[k]; });
  for (Offset item = first; item < last; ++item) {
    const int k = key(item);
    order[begins[k] + group_sum(k, own_group) + counter(k, team.rank())++] = item;
  }
  team.sync();
}

}  // namespace stiction::inline STICTION_ISA
