#pragma once

#include "core/algorithm/velocity/slots.hpp"

namespace stiction::inline STICTION_ISA {

/// The elimination tree of M + J'DJ, leaves first. Row k of the factor may have entries at k's ancestors only, and
/// keeps one for each of them, the root first. So a row is contiguous, and eliminating k updates leading parts of its
/// ancestors' rows; no list of indices is needed. What is added to the true pattern holds exact zeros.
///
/// J. W. H. Liu, The role of elimination trees in sparse factorization, SIAM J. Matrix Anal. Appl. 11 (1990); for
/// kinematic trees R. Featherstone, Efficient factorization of the joint-space inertia matrix, IJRR 24 (2005).
struct DofTree {
  static constexpr Index kMostEntries = kMostVelocityDofs * (kMostVelocityDofs + 1) / 2;
  Index dofs;
  Index entries;
  Index begin[kMostVelocityDofs];        ///< first entry of row k
  Index depth[kMostVelocityDofs];        ///< ancestors of k
  unsigned char ancestor[kMostEntries];  ///< of entry begin[k] + d: k's ancestor of depth d, k itself the last

  [[nodiscard]] STICTION_HD const unsigned char* path(Index k) const { return ancestor + begin[k]; }
  [[nodiscard]] STICTION_HD Index diagonal(Index k) const { return begin[k] + depth[k]; }
};

/// The tree of a pack, and where in it the slots' columns are. coupled[k]: degrees of freedom before k that M couples
/// it with in any lane; overwritten.
template <int kLanes>
STICTION_HD_OUTLINE void build_tree(DofTree& tree, Index dofs, DofSet (&coupled)[kMostVelocityDofs],
                                    Slot<kLanes>* slots, Index slot_count) {
  tree.dofs = dofs;
  for (Index s = 0; s < slot_count; ++s) {
    if (slots[s].dofs == 0) continue;
    const Index last = highest_bit(slots[s].dofs);
    coupled[last] |= slots[s].dofs & below(last);
  }
  for (Index k = dofs - 1; k > 0; --k) {
    if (coupled[k] == 0) continue;
    const Index parent = highest_bit(coupled[k]);
    coupled[parent] |= coupled[k] & below(parent);
  }
  Index entries = 0;
  for (Index k = 0; k < dofs; ++k) {
    tree.begin[k] = entries;
    tree.depth[k] = 0;
    if (coupled[k] != 0) {
      const Index parent = highest_bit(coupled[k]);
      tree.depth[k] = tree.depth[parent] + 1;
      for (Index d = 0; d < tree.depth[k]; ++d) tree.ancestor[entries + d] = tree.ancestor[tree.begin[parent] + d];
    }
    tree.ancestor[entries + tree.depth[k]] = static_cast<unsigned char>(k);
    entries += tree.depth[k] + 1;
  }
  tree.entries = entries;
  for (Index s = 0; s < slot_count; ++s)
    for (Index c = 0; c < slots[s].columns; ++c)
      slots[s].depth[c] = static_cast<unsigned char>(tree.depth[slots[s].dof[c]]);
}

/// The pivot of row k, inverted; `definite` keeps the lanes in which it is positive.
template <class Numbers, class Condition>
STICTION_HD auto invert_pivot(const DofTree& tree, const Numbers& H, const Numbers& inverse, Index k,
                              Condition& definite) {
  using Value = decltype(H[0]);
  const Value pivot = H[tree.diagonal(k)];
  const auto is_positive = and_(pivot > Value(0), finite_(pivot));
  definite = and_(definite, is_positive);
  const Value inverted = div_(Value(1), select(is_positive, pivot, Value(1)));
  inverse.put(k, inverted);
  return inverted;
}

/// Takes rows out of kTargets ancestors of them, those of depth last, last - 1, ..., and turns their entries there into
/// the factor's. `rows` are eliminated one after the other, and every entry is changed in that order.
template <int kRows, int kTargets, class Numbers, class Value>
STICTION_HD void eliminate(const DofTree& tree, const Numbers& H, const unsigned char* path, Index last,
                           const Numbers (&rows)[kRows], const Value (&inverted)[kRows]) {
  Numbers target[kTargets];
  Value factor[kRows][kTargets];
  Value minus[kRows][kTargets];
  for (int t = 0; t < kTargets; ++t) {
    target[t] = H.from(tree.begin[path[last - t]]);
    for (int r = 0; r < kRows; ++r) {
      factor[r][t] = rows[r][last - t] * inverted[r];
      minus[r][t] = Value(0) - factor[r][t];
    }
  }
  for (Index d = 0; d <= last - (kTargets - 1); ++d) {
    Value entry[kRows];
    for (int r = 0; r < kRows; ++r) entry[r] = rows[r][d];
    for (int t = 0; t < kTargets; ++t) {
      Value sum = target[t][d];
      for (int r = 0; r < kRows; ++r) sum = fma_(minus[r][t], entry[r], sum);
      target[t].put(d, sum);
    }
  }
  for (int t = 0; t + 1 < kTargets; ++t)
    for (Index d = last - (kTargets - 1) + 1; d <= last - t; ++d) {
      Value sum = target[t][d];
      for (int r = 0; r < kRows; ++r) sum = fma_(minus[r][t], rows[r][d], sum);
      target[t].put(d, sum);
    }
  for (int t = 0; t < kTargets; ++t)
    for (int r = 0; r < kRows; ++r) rows[r].put(last - t, factor[r][t]);
}
template <int kRows, class Numbers, class Value>
STICTION_HD void eliminate_all(const DofTree& tree, const Numbers& H, const unsigned char* path, Index last,
                               const Numbers (&rows)[kRows], const Value (&inverted)[kRows]) {
  for (; last > 0; last -= 2) eliminate<kRows, 2>(tree, H, path, last, rows, inverted);
  if (last == 0) eliminate<kRows, 1>(tree, H, path, last, rows, inverted);
}

/// H = L'DL in place, in the tree's envelope; `inverse` gets D^-1. Rows of L below, the diagonal keeps D. Returns the
/// lanes in which every pivot is positive. A row and its parent, where that is the next, are eliminated in one pass
/// over their ancestors. That halves the loads and stores, and each entry is changed in the same order.
template <class Numbers>
STICTION_HD_OUTLINE auto factor_tree(const DofTree& tree, const Numbers& H, const Numbers& inverse) {
  using Value = decltype(H[0]);
  Mask<Value> definite = Value(0) == Value(0);
  for (Index k = tree.dofs - 1; k >= 0;) {
    const Numbers row = H.from(tree.begin[k]);
    const Value inverted = invert_pivot(tree, H, inverse, k, definite);
    const Index parent = k - 1;
    if (tree.depth[k] == 0 || tree.path(k)[tree.depth[k] - 1] != parent) {
      const Numbers rows[1] = {row};
      const Value pivots[1] = {inverted};
      eliminate_all<1>(tree, H, tree.path(k), tree.depth[k] - 1, rows, pivots);
      --k;
      continue;
    }
    const Numbers next = H.from(tree.begin[parent]);
    const Index last = tree.depth[parent];
    const Value factor = row[last] * inverted;
    const Value minus = Value(0) - factor;
    for (Index d = 0; d <= last; ++d) next.put(d, fma_(minus, row[d], next[d]));
    row.put(last, factor);
    const Numbers rows[2] = {row, next};
    const Value pivots[2] = {inverted, invert_pivot(tree, H, inverse, parent, definite)};
    eliminate_all<2>(tree, H, tree.path(parent), last - 1, rows, pivots);
    k -= 2;
  }
  return definite;
}

/// L becomes L'L in place, L in the tree's envelope: what factor_tree does, undone from the root on.
template <class Numbers>
STICTION_HD_OUTLINE void multiply_tree(const DofTree& tree, const Numbers& L) {
  for (Index k = 0; k < tree.dofs; ++k) {
    const Numbers row = L.from(tree.begin[k]);
    const unsigned char* const path = tree.path(k);
    for (Index t = 0; t <= tree.depth[k]; ++t) {
      const Numbers target = L.from(tree.begin[path[t]]);
      const auto factor = row[t];
      const bool is_own = t == tree.depth[k];
      for (Index d = 0; d <= t; ++d) target.put(d, is_own ? factor * row[d] : fma_(factor, row[d], target[d]));
    }
  }
}

/// L with a diagonal becomes that of L'DL, as factor_tree leaves it. The lanes in which the diagonal is positive.
template <class Numbers>
STICTION_HD_OUTLINE auto split_pivots(const DofTree& tree, const Numbers& L, const Numbers& inverse) {
  using Value = decltype(L[0]);
  Mask<Value> definite = Value(0) == Value(0);
  for (Index k = 0; k < tree.dofs; ++k) {
    const Numbers row = L.from(tree.begin[k]);
    const Value diagonal = row[tree.depth[k]];
    const auto is_positive = diagonal > Value(0);
    const Value divided = div_(Value(1), select(is_positive, diagonal, Value(1)));
    for (Index d = 0; d < tree.depth[k]; ++d) row.put(d, row[d] * divided);
    row.put(tree.depth[k], diagonal * diagonal);
    definite = and_(definite, is_positive);
    invert_pivot(tree, L, inverse, k, definite);
  }
  return definite;
}

/// x becomes (L'DL)^-1 x  (dofs).
template <class Numbers>
STICTION_HD_OUTLINE void solve_tree(const DofTree& tree, const Numbers& L, const Numbers& inverse, const Numbers& x) {
  using Value = decltype(L[0]);
  for (Index k = tree.dofs - 1; k > 0; --k) {
    const Numbers row = L.from(tree.begin[k]);
    const unsigned char* const path = tree.path(k);
    const Value minus = Value(0) - x[k];
    for (Index e = 0; e < tree.depth[k]; ++e) x.put(path[e], fma_(minus, row[e], x[path[e]]));
  }
  for (Index k = 0; k < tree.dofs; ++k) {
    const Numbers row = L.from(tree.begin[k]);
    const unsigned char* const path = tree.path(k);
    Value sum = x[k] * inverse[k];
    for (Index e = 0; e < tree.depth[k]; ++e) sum = fma_(Value(0) - row[e], x[path[e]], sum);
    x.put(k, sum);
  }
}

}  // namespace stiction::inline STICTION_ISA
