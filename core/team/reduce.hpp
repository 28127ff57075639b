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
template <class T, Block B, class F>
STICTION_HD T sum_leaves(B& block, F&& leaf) {
  if (block.size() == 1) {
    T local[kReduceLeaves];
    for (Index l = 0; l < kReduceLeaves; ++l) local[l] = leaf(l);
    return fold_leaves(local);
  }
  T* shared = block.template leaves<T>();
  for (Index l = block.rank(); l < kReduceLeaves; l += block.size()) shared[l] = leaf(l);
  block.sync();
  return block.broadcast([&] { return fold_leaves(shared); });
}

/// The sum of n numbers, on every lane.
template <class T, Block B>
STICTION_HD_OUTLINE T sum_values(B& block, const T* values, Index n) {
  return sum_leaves<T>(block, [&](Index leaf) {
    T sum(0);
    for (Index i = leaf; i < n; i += kReduceLeaves) sum = sum + values[i];
    return sum;
  });
}

/// The largest of zero and f(i), i in [0, n); on every lane.
template <class T, Block B, class F>
STICTION_HD T max_over(B& block, Index n, F&& f) {
  T largest = T(0);
  for (Index i = block.rank(); i < n; i += block.size()) largest = max_(f(i), largest);
  return block.max(largest);
}

}  // namespace stiction::inline STICTION_ISA
