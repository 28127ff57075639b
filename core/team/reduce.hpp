#pragma once

#include "core/team/phases.hpp"

namespace stiction::inline STICTION_ISA {

/// Leaves of every sum. Fixed, so that no sum depends on how many lanes there are.
inline constexpr Index kReduceLeaves = 32;

/// The tree over 32 leaves: neighbours 16, 8, 4, 2, 1 apart. Destroys the leaves.
template <class T>
STICTION_HD T fold_leaves(T* leaf) {
  for (Index distance = kReduceLeaves / 2; distance > 0; distance /= 2)
    for (Index l = 0; l < distance; ++l) leaf[l] = leaf[l] + leaf[l + distance];
  return leaf[0];
}

/// The sum of leaf(l), l = 0..31, where leaf(l) is computed by one lane alone. The result is on every lane and depends
/// neither on the number of lanes nor on the machine.
template <class T, Team TeamT, class F>
STICTION_HD T sum_leaves(TeamT& team, F&& leaf) {
  if (team.size() == 1) {
    T local[kReduceLeaves];
    for (Index l = 0; l < kReduceLeaves; ++l) local[l] = leaf(l);
    return fold_leaves(local);
  }
  T* shared = team.template leaves<T>();
  for (Index l = team.rank(); l < kReduceLeaves; l += team.size()) shared[l] = leaf(l);
  team.sync();
  return team.broadcast([&] { return fold_leaves(shared); });
}

/// The sum of n numbers, on every lane.
template <class T, Team TeamT>
STICTION_HD_OUTLINE T sum_values(TeamT& team, const T* values, Index n) {
  return sum_leaves<T>(team, [&](Index leaf) {
    T sum(0);
    for (Index i = leaf; i < n; i += kReduceLeaves) sum = sum + values[i];
    return sum;
  });
}

/// The largest of zero and f(i), i in [0, n); on every lane.
template <class T, Team TeamT, class F>
STICTION_HD T max_over(TeamT& team, Index n, F&& f) {
  T largest = T(0);
  for (Index i = team.rank(); i < n; i += team.size()) largest = max_(f(i), largest);
  return team.max(largest);
}

}  // namespace stiction::inline STICTION_ISA
