#pragma once

#include "core/team/phases.hpp"

namespace stiction::inline STICTION_ISA {

/// Swaps a[i] and a[j] if they are out of order; j may lie beyond the end, where everything is larger.
template <class T, class Before>
STICTION_HD void order_pair(T* a, Offset i, Offset j, Index n, Before&& before) {
  if (j >= n || !before(a[j], a[i])) return;
  const T held = a[i];
  a[i] = a[j];
  a[j] = held;
}

/// Sorts a[0 .. n) by `before`, a strict order without ties, so that there is one result whatever the lanes do. It is
/// the bitonic network in the form whose comparators all point upwards (the first of each merge compares mirror
/// images). Then the places beyond n need not exist. An array that is sorted already costs one look.
template <Team TeamT, class T, class Before>
STICTION_HD void sort_network(TeamT& team, Index n, T* a, Before&& before) {
  std::uint32_t unsorted = 0;
  for (Index i = team.rank(); i + 1 < n; i += team.size()) unsorted |= before(a[i + 1], a[i]) ? 1U : 0U;
  if (team.combine(unsorted) == 0) return;
  int levels = 0;
  while ((Offset{1} << levels) < n) ++levels;
  const Index pairs = static_cast<Index>(Offset{1} << (levels - 1));
  for (int merge = 0; merge < levels; ++merge) {
    const Offset half = Offset{1} << merge;
    for_each(team, pairs, [&](Index pair) {
      const Offset begin = (Offset{pair} >> merge) << (merge + 1);
      const Offset inner = pair & (half - 1);
      order_pair(a, begin + inner, begin + 2 * half - 1 - inner, n, before);
    });
    for (int step = merge - 1; step >= 0; --step) {
      const Offset distance = Offset{1} << step;
      for_each(team, pairs, [&](Index pair) {
        const Offset i = ((Offset{pair} >> step) << (step + 1)) + (pair & (distance - 1));
        order_pair(a, i, i + distance, n, before);
      });
    }
  }
}

/// The first of sorted a[0 .. n) that is not before `key`; n if all are.
template <class T, class Key, class Before>
STICTION_HD Index lower_bound(const T* a, Index n, const Key& key, Before&& before) {
  Index low = 0;
  Index high = n;
  while (low < high) {
    const Index middle = low + (high - low) / 2;
    if (before(a[middle], key)) {
      low = middle + 1;
    } else {
      high = middle;
    }
  }
  return low;
}

}  // namespace stiction::inline STICTION_ISA
