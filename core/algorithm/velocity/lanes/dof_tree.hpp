#pragma once

#include <type_traits>

#include "core/algorithm/velocity/lanes/slots.hpp"
#include "core/team/phases.hpp"

namespace stiction::inline STICTION_ISA {

/// The elimination tree of M + J'DJ, leaves first. Row k of the factor may have entries at k's ancestors only, and
/// keeps one for each of them, the root first. A row is hence contiguous; eliminating k updates leading parts of its
/// ancestors' rows, without a list of indices. Entries added to the true pattern hold zeros. A large tree's row begins
/// at the first ancestor for which it has an entry. Bodies in a row make one path, and a narrow band.
///
/// J. W. H. Liu, The role of elimination trees in sparse factorization, SIAM J. Matrix Anal. Appl. 11 (1990); for
/// kinematic trees R. Featherstone, Efficient factorization of the joint-space inertia matrix, IJRR 24 (2005).
template <class Set>
struct DofTree {
  using Small = typename SetTraits<Set>::Small;
  using Begin = std::conditional_t<SetTraits<Set>::kIsWord, std::uint16_t, Index>;
  static constexpr bool kIsWhole = SetTraits<Set>::kIsWord;  ///< a row has an entry for every ancestor
  static constexpr Index kMostDofs = SetTraits<Set>::kMost;
  static constexpr Index kMostEntries = kIsWhole ? kMostDofs * (kMostDofs + 1) / 2 : kMostLargeEntries;
  static constexpr Index kMostPaths = kIsWhole ? kMostEntries : kMostLargePaths;
  Index dofs;
  Index entries;
  Index levels;                                 ///< existing depths
  Begin begin[kMostDofs];                       ///< entry of row k for depth 0, which it may not have
  Small depth[kMostDofs];                       ///< ancestors of k
  Index first_depth[kIsWhole ? 1 : kMostDofs];  ///< of the first ancestor that row k has an entry for
  Index path_begin[kIsWhole ? 1 : kMostDofs];
  Small by_depth[kMostDofs];         ///< degrees of freedom, those of a level side by side; teams alone
  Small level_begin[kMostDofs + 2];  ///< of levels, in by_depth; teams alone
  Small ancestor[kMostPaths];        ///< paths from the root; where a row is whole, of each entry

  /// k's ancestors, the root first, k itself the last.
  [[nodiscard]] STICTION_HD const Small* path(Index k) const {
    return ancestor + (kIsWhole ? begin[k] : path_begin[kIsWhole ? 0 : k]);
  }
  [[nodiscard]] STICTION_HD Index first(Index k) const { return kIsWhole ? 0 : first_depth[kIsWhole ? 0 : k]; }
  [[nodiscard]] STICTION_HD Index diagonal(Index k) const { return begin[k] + depth[k]; }
  /// Returns true if row k has an entry for that depth.
  [[nodiscard]] STICTION_HD bool has(Index k, Index at) const { return at >= first(k) && at <= depth[k]; }
};

/// Row k of a tree that has all before it, whose ancestors are those of `coupled` and their ancestors. If the list of
/// paths ends with the parent's, k goes on with it. Without `kCopies` a path has k and its parent alone. Returns false
/// if there was no room.
template <bool kCopies, class Set>
STICTION_HD bool add_row(DofTree<Set>& tree, Index k, const Set& coupled, Index& paths) {
  using Small = typename SetTraits<Set>::Small;
  constexpr bool kIsWhole = DofTree<Set>::kIsWhole;
  const Index parent = is_empty(coupled) ? -1 : highest_bit(coupled);
  const Index depth = parent < 0 ? 0 : tree.depth[parent] + 1;
  const Index first = kIsWhole || parent < 0 ? 0 : tree.depth[lowest_bit(coupled)];
  tree.depth[k] = static_cast<Small>(depth);
  tree.levels = depth < tree.levels ? tree.levels : depth + 1;
  tree.begin[k] = static_cast<typename DofTree<Set>::Begin>(tree.entries - first);
  tree.entries += depth + 1 - first;
  if constexpr (!kIsWhole) {
    const bool goes_on = parent >= 0 && tree.path_begin[parent] + depth == paths;
    tree.first_depth[k] = first;
    tree.path_begin[k] = goes_on ? tree.path_begin[parent] : paths;
    paths = tree.path_begin[k] + depth + 1;
    if (tree.entries > DofTree<Set>::kMostEntries || paths > DofTree<Set>::kMostPaths) return false;
  }
  Small* const path = tree.ancestor + (kIsWhole ? tree.begin[k] : tree.path_begin[kIsWhole ? 0 : k]);
  if constexpr (kCopies) {
    if (parent >= 0 && tree.path(parent) != path)
      for (Index d = 0; d < depth; ++d) path[d] = tree.path(parent)[d];
  } else {
    if (parent >= 0) path[depth - 1] = static_cast<Small>(parent);
  }
  path[depth] = static_cast<Small>(k);
  return true;
}

/// Rows of a tree. coupled[k]: degrees of freedom before k that M couples it with in any lane; overwritten. Returns
/// false if there was no room.
template <bool kCopies, int kLanes, class Set>
STICTION_HD bool add_rows(DofTree<Set>& tree, Index dofs, Set* coupled, const Slot<kLanes, Set>* slots,
                          Index slot_count) {
  tree.dofs = dofs;
  for (Index s = 0; s < slot_count; ++s) {
    if (slots[s].columns < 2) continue;
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
    if (!add_row<kCopies>(tree, k, coupled[k], paths)) return false;
  return true;
}

/// Lists the degrees of freedom by depth.
template <class Set>
STICTION_HD void list_levels(DofTree<Set>& tree) {
  using Small = typename SetTraits<Set>::Small;
  Small* const begin = tree.level_begin;  // of level d, at d + 1 until all are listed
  for (Index i = 0; i < tree.levels + 2; ++i) begin[i] = 0;
  for (Index k = 0; k < tree.dofs; ++k) ++begin[tree.depth[k] + 2];
  for (Index i = 2; i < tree.levels + 2; ++i) begin[i] = static_cast<Small>(begin[i] + begin[i - 1]);
  for (Index k = 0; k < tree.dofs; ++k) tree.by_depth[begin[tree.depth[k] + 1]++] = static_cast<Small>(k);
}

/// The tree of a pack, and where in it the slots' columns are. Lanes of a team go up from a degree of freedom each.
template <Team TeamT, int kLanes, class Set>
STICTION_HD_OUTLINE bool build_tree(TeamT& team, DofTree<Set>& tree, Index dofs, Set* coupled, Slot<kLanes, Set>* slots,
                                    Index slot_count) {
  using Small = typename SetTraits<Set>::Small;
  constexpr bool kCopies = kIsAlone<TeamT>;
  if (!team.broadcast([&] { return add_rows<kCopies>(tree, dofs, coupled, slots, slot_count); })) return false;
  if constexpr (!kCopies) {
    for_each(team, dofs, [&](Index k) {
      Small* const path = tree.ancestor + tree.begin[k];
      for (Index d = tree.depth[k] - 1; d > 0; --d) path[d - 1] = tree.path(path[d])[d - 1];
    });
    single(team, [&] { list_levels(tree); });
  }
  for_each(team, slot_count, [&](Index s) {
    for (Index c = 0; c < slots[s].columns; ++c) slots[s].depth()[c] = static_cast<Small>(tree.depth[slots[s].dof[c]]);
  });
  return true;
}

}  // namespace stiction::inline STICTION_ISA
