#pragma once

#include "core/algorithm/velocity/lanes/slots.hpp"
#include "core/team/phases.hpp"

namespace stiction::inline STICTION_ISA {

/// The elimination tree of M + J'DJ, leaves first. Row k of the factor may have entries at k's ancestors only, and
/// keeps one for each of them, the root first. So a row is contiguous, and eliminating k updates leading parts of its
/// ancestors' rows; no list of indices is needed. What is added to the true pattern holds exact zeros. A large tree's
/// row begins at the first ancestor for which it has an entry. Bodies in a row make one path, and a narrow band.
///
/// J. W. H. Liu, The role of elimination trees in sparse factorization, SIAM J. Matrix Anal. Appl. 11 (1990); for
/// kinematic trees R. Featherstone, Efficient factorization of the joint-space inertia matrix, IJRR 24 (2005).
template <class Set>
struct DofTree {
  using Small = typename SetTraits<Set>::Small;
  static constexpr bool kIsWhole = SetTraits<Set>::kIsWord;  ///< a row has an entry for every ancestor
  static constexpr Index kMostDofs = SetTraits<Set>::kMost;
  static constexpr Index kMostEntries = kIsWhole ? kMostDofs * (kMostDofs + 1) / 2 : kMostLargeEntries;
  static constexpr Index kMostPaths = kIsWhole ? kMostEntries : kMostLargePaths;
  Index dofs;
  Index entries;
  Index levels;                                 ///< depths that there are
  Index begin[kMostDofs];                       ///< entry of row k for depth 0, which it may not have
  Index depth[kMostDofs];                       ///< ancestors of k
  Index first_depth[kIsWhole ? 1 : kMostDofs];  ///< of the first ancestor that row k has an entry for
  Index path_begin[kIsWhole ? 1 : kMostDofs];
  Small ancestor[kMostPaths];  ///< paths from the root; where a row is whole, of each entry

  /// k's ancestors, the root first, k itself the last.
  [[nodiscard]] STICTION_HD const Small* path(Index k) const {
    return ancestor + (kIsWhole ? begin[k] : path_begin[kIsWhole ? 0 : k]);
  }
  [[nodiscard]] STICTION_HD Index first(Index k) const { return kIsWhole ? 0 : first_depth[kIsWhole ? 0 : k]; }
  [[nodiscard]] STICTION_HD Index diagonal(Index k) const { return begin[k] + depth[k]; }
  /// Whether row k has an entry for that depth.
  [[nodiscard]] STICTION_HD bool has(Index k, Index at) const { return at >= first(k) && at <= depth[k]; }
};

/// Row k of a tree that has all before it, whose ancestors are those of `coupled` and what these have. Where the list
/// of paths ends with the parent's, k goes on with it. Whether there was room.
template <class Set>
STICTION_HD bool add_row(DofTree<Set>& tree, Index k, const Set& coupled, Index& paths) {
  using Small = typename SetTraits<Set>::Small;
  constexpr bool kIsWhole = DofTree<Set>::kIsWhole;
  const Index parent = is_empty(coupled) ? -1 : highest_bit(coupled);
  const Index depth = parent < 0 ? 0 : tree.depth[parent] + 1;
  const Index first = kIsWhole || parent < 0 ? 0 : tree.depth[lowest_bit(coupled)];
  tree.depth[k] = depth;
  tree.levels = depth < tree.levels ? tree.levels : depth + 1;
  tree.begin[k] = tree.entries - first;
  tree.entries += depth + 1 - first;
  if constexpr (!kIsWhole) {
    const bool goes_on = parent >= 0 && tree.path_begin[parent] + depth == paths;
    tree.first_depth[k] = first;
    tree.path_begin[k] = goes_on ? tree.path_begin[parent] : paths;
    paths = tree.path_begin[k] + depth + 1;
    if (tree.entries > DofTree<Set>::kMostEntries || paths > DofTree<Set>::kMostPaths) return false;
  }
  Small* const path = tree.ancestor + (kIsWhole ? tree.begin[k] : tree.path_begin[kIsWhole ? 0 : k]);
  if (parent >= 0 && tree.path(parent) != path)
    for (Index d = 0; d < depth; ++d) path[d] = tree.path(parent)[d];
  path[depth] = static_cast<Small>(k);
  return true;
}

/// The tree of a pack, and where in it the slots' columns are. coupled[k]: degrees of freedom before k that M couples
/// it with in any lane; overwritten. Whether there was room.
template <int kLanes, class Set>
STICTION_HD_OUTLINE bool build_tree(DofTree<Set>& tree, Index dofs, Set* coupled, Slot<kLanes, Set>* slots,
                                    Index slot_count) {
  tree.dofs = dofs;
  for (Index s = 0; s < slot_count; ++s) {
    if (is_empty(slots[s].dofs)) continue;
    const Index last = highest_bit(slots[s].dofs);
    coupled[last] |= slots[s].dofs & below<Set>(last);
  }
  for (Index k = dofs - 1; k > 0; --k) {
    if (is_empty(coupled[k])) continue;
    const Index parent = highest_bit(coupled[k]);
    coupled[parent] |= coupled[k] & below<Set>(parent);
  }
  tree.entries = 0;
  tree.levels = 0;
  Index paths = 0;
  for (Index k = 0; k < dofs; ++k)
    if (!add_row(tree, k, coupled[k], paths)) return false;
  for (Index s = 0; s < slot_count; ++s)
    for (Index c = 0; c < slots[s].columns; ++c)
      slots[s].depth[c] = static_cast<typename SetTraits<Set>::Small>(tree.depth[slots[s].dof[c]]);
  return true;
}

/// f(k) of every row, each after its ancestors'; ends in a sync.
template <Team TeamT, class Set, class F>
STICTION_HD void for_each_from_root(TeamT& team, const DofTree<Set>& tree, F&& f) {
  if constexpr (kIsAlone<TeamT>) {
    for (Index k = 0; k < tree.dofs; ++k) f(k);
  } else {
    for (Index level = 0; level < tree.levels; ++level)
      for_each(team, tree.dofs, [&](Index k) {
        if (tree.depth[k] == level) f(k);
      });
  }
}

/// The pivot of row k, inverted; `definite` keeps the lanes in which it is positive.
template <Team TeamT, class Set, class Numbers, class Condition>
STICTION_HD auto invert_pivot(TeamT& team, const DofTree<Set>& tree, const Numbers& H, const Numbers& inverse, Index k,
                              Condition& definite) {
  using Value = decltype(H[0]);
  const Value pivot = H[tree.diagonal(k)];
  const auto is_positive = and_(pivot > Value(0), finite_(pivot));
  definite = and_(definite, is_positive);
  const Value inverted = div_(Value(1), select(is_positive, pivot, Value(1)));
  if (team.rank() == 0) inverse.put(k, inverted);
  return inverted;
}

/// Takes rows out of kTargets ancestors of them, those of depth last, last - 1, ..., and turns their entries there into
/// the factor's if kScales. `rows`, which begin at depth `first`, are eliminated one after the other, and every entry
/// is changed in that order.
template <int kRows, int kTargets, bool kScales, class Set, class Numbers, class Value>
STICTION_HD void eliminate(const DofTree<Set>& tree, const Numbers& H, const typename SetTraits<Set>::Small* path,
                           Index first, Index last, const Numbers (&rows)[kRows], const Value (&inverted)[kRows]) {
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
  for (Index d = first; d <= last - (kTargets - 1); ++d) {
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
  if constexpr (kScales)
    for (int t = 0; t < kTargets; ++t)
      for (int r = 0; r < kRows; ++r) rows[r].put(last - t, factor[r][t]);
}
/// Takes rows out of all ancestors from depth `last` on; ends in a sync. Lanes take an ancestor each, and leave the
/// rows as they are, which others read.
template <int kRows, Team TeamT, class Set, class Numbers, class Value>
STICTION_HD void eliminate_all(TeamT& team, const DofTree<Set>& tree, const Numbers& H,
                               const typename SetTraits<Set>::Small* path, Index first, Index last,
                               const Numbers (&rows)[kRows], const Value (&inverted)[kRows]) {
  if constexpr (kIsAlone<TeamT>) {
    for (; last > first; last -= 2) eliminate<kRows, 2, true>(tree, H, path, first, last, rows, inverted);
    if (last == first) eliminate<kRows, 1, true>(tree, H, path, first, last, rows, inverted);
  } else {
    for_each(team, last + 1 - first,
             [&](Index i) { eliminate<kRows, 1, false>(tree, H, path, first, last - i, rows, inverted); });
  }
}

/// H = L'DL in place, in the tree's envelope; `inverse` gets D^-1. Rows of L below, the diagonal keeps D. Returns the
/// lanes in which every pivot is positive. A row and its parent, where that is the next and begins with it, are
/// eliminated in one pass over their ancestors. That halves the loads and stores, and each entry is changed in the same
/// order.
template <Team TeamT, class Set, class Numbers>
STICTION_HD_OUTLINE auto factor_tree(TeamT& team, const DofTree<Set>& tree, const Numbers& H, const Numbers& inverse) {
  using Value = decltype(H[0]);
  Mask<Value> definite = Value(0) == Value(0);
  for (Index k = tree.dofs - 1; k >= 0;) {
    const Numbers row = H.from(tree.begin[k]);
    const Value inverted = invert_pivot(team, tree, H, inverse, k, definite);
    const Index parent = k - 1, first = tree.first(k);
    if (tree.depth[k] == 0 || tree.path(k)[tree.depth[k] - 1] != parent || tree.first(parent) != first) {
      const Numbers rows[1] = {row};
      const Value pivots[1] = {inverted};
      eliminate_all<1>(team, tree, H, tree.path(k), first, tree.depth[k] - 1, rows, pivots);
      --k;
      continue;
    }
    const Numbers next = H.from(tree.begin[parent]);
    const Index last = tree.depth[parent];
    const Value factor = row[last] * inverted;
    const Value minus = Value(0) - factor;
    for_each(team, last + 1 - first, [&](Index i) {
      const Index d = first + i;
      next.put(d, fma_(minus, row[d], next[d]));
    });
    if constexpr (kIsAlone<TeamT>) row.put(last, factor);
    const Numbers rows[2] = {row, next};
    const Value pivots[2] = {inverted, invert_pivot(team, tree, H, inverse, parent, definite)};
    eliminate_all<2>(team, tree, H, tree.path(parent), first, last - 1, rows, pivots);
    k -= 2;
  }
  if constexpr (!kIsAlone<TeamT>)
    for_each(team, tree.dofs, [&](Index k) {
      const Numbers row = H.from(tree.begin[k]);
      const Value inverted = inverse[k];
      for (Index d = tree.first(k); d < tree.depth[k]; ++d) row.put(d, row[d] * inverted);
    });
  return definite;
}

/// L becomes L'L in place, L in the tree's envelope: what factor_tree does, undone from the root on.
template <Team TeamT, class Set, class Numbers>
STICTION_HD_OUTLINE void multiply_tree(TeamT& team, const DofTree<Set>& tree, const Numbers& L) {
  for (Index k = 0; k < tree.dofs; ++k) {
    const Numbers row = L.from(tree.begin[k]);
    const auto* const path = tree.path(k);
    const Index first = tree.first(k), own = tree.depth[k];
    for_each(team, own - first, [&](Index i) {
      const Numbers target = L.from(tree.begin[path[first + i]]);
      const auto factor = row[first + i];
      for (Index d = first; d <= first + i; ++d) target.put(d, fma_(factor, row[d], target[d]));
    });
    const auto diagonal = row[own];
    team.sync();  // all have read it
    for_each(team, own + 1 - first, [&](Index i) { row.put(first + i, diagonal * row[first + i]); });
  }
}

/// L with a diagonal becomes that of L'DL, as factor_tree leaves it. The lanes in which the diagonal is positive.
template <Team TeamT, class Set, class Numbers>
STICTION_HD_OUTLINE auto split_pivots(TeamT& team, const DofTree<Set>& tree, const Numbers& L, const Numbers& inverse) {
  using Value = decltype(L[0]);
  Mask<Value> definite = Value(0) == Value(0);
  for_each(team, tree.dofs, [&](Index k) {
    const Numbers row = L.from(tree.begin[k]);
    const Value diagonal = row[tree.depth[k]];
    const auto is_positive = diagonal > Value(0);
    const Value divided = div_(Value(1), select(is_positive, diagonal, Value(1)));
    for (Index d = tree.first(k); d < tree.depth[k]; ++d) row.put(d, row[d] * divided);
    row.put(tree.depth[k], diagonal * diagonal);
    definite = and_(definite, is_positive);
    SerialTeam lane;
    invert_pivot(lane, tree, L, inverse, k, definite);
  });
  return on_all_lanes(team, definite);
}

/// x becomes (L'DL)^-1 x  (dofs).
template <Team TeamT, class Set, class Numbers>
STICTION_HD_OUTLINE void solve_tree(TeamT& team, const DofTree<Set>& tree, const Numbers& L, const Numbers& inverse,
                                    const Numbers& x) {
  using Value = decltype(L[0]);
  for (Index k = tree.dofs - 1; k > 0; --k) {
    const Index first = tree.first(k);
    const Numbers row = L.from(tree.begin[k] + first);
    const auto* const path = tree.path(k) + first;
    const Value minus = Value(0) - x[k];
    for_each(team, tree.depth[k] - first, [&](Index e) { x.put(path[e], fma_(minus, row[e], x[path[e]])); });
  }
  for_each_from_root(team, tree, [&](Index k) {
    const Numbers row = L.from(tree.begin[k]);
    const auto* const path = tree.path(k);
    Value sum = x[k] * inverse[k];
    for (Index e = tree.first(k); e < tree.depth[k]; ++e) sum = fma_(Value(0) - row[e], x[path[e]], sum);
    x.put(k, sum);
  });
}

}  // namespace stiction::inline STICTION_ISA
