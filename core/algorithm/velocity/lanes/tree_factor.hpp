#pragma once

#include <type_traits>

#include "core/algorithm/velocity/lanes/dof_tree.hpp"

/// The factor L'DL of a matrix in the envelope of a tree, and solves by it.
namespace stiction::inline STICTION_ISA {

/// A pivot, inverted; `definite` keeps the lanes in which it is positive.
template <class Value, class Condition>
STICTION_HD Value inverted_pivot(Value pivot, Condition& definite) {
  const auto is_positive = and_(pivot > Value(0), finite_(pivot));
  definite = and_(definite, is_positive);
  return div_(Value(1), select(is_positive, pivot, Value(1)));
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

/// Most rows that are eliminated together. A pack's lane has registers for two.
template <class TeamT>
inline constexpr Index kMostChain = kIsAlone<TeamT> ? 2 : 4;

/// f(kRows, k) for chains of rows from the last one to the first: four rows, two or one, k and those before it. Each is
/// the only child of the next, or its last, and their rows begin at one ancestor.
template <Index kMost, class Set, class F>
STICTION_HD void for_each_chain(const DofTree<Set>& tree, F&& f) {
  for (Index k = tree.dofs - 1; k >= 0;) {
    Index rows = 1;
    while (rows < kMost && rows <= tree.depth[k] && tree.path(k)[tree.depth[k] - rows] == k - rows &&
           tree.first(k - rows) == tree.first(k))
      ++rows;
    if constexpr (kMost == 4) {
      if (rows == 4) {
        f(std::integral_constant<int, 4>{}, k);
        k -= 4;
        continue;
      }
    }
    if (rows > 1) {
      f(std::integral_constant<int, 2>{}, k);
      k -= 2;
    } else {
      f(std::integral_constant<int, 1>{}, k);
      --k;
    }
  }
}

/// Eliminates a chain of kRows rows; ends in a sync. Every lane finds the chain's own entries. Then it takes a column
/// of the chain at a time, then an ancestor's row. It halves loads and stores, and each entry is changed in the order
/// of rows. One lane turns entries into the factor's as it goes; lanes of a team read entries that others need.
template <int kRows, Team TeamT, class Set, class Numbers, class Condition>
STICTION_HD void eliminate_chain(TeamT& team, const DofTree<Set>& tree, const Numbers& H, const Numbers& inverse,
                                 Index k, Condition& definite) {
  using Value = decltype(H[0]);
  constexpr bool kScales = kIsAlone<TeamT>;
  const Index depth = tree.depth[k], first = tree.first(k);
  Index last = depth - kRows;
  Numbers row[kRows];
  Value own[kRows][kRows];  // of row r, in the column of row q
  Value factor[kRows][kRows] = {};
  Value inverted[kRows];
  for (int r = 0; r < kRows; ++r) {
    row[r] = H.from(tree.begin[k - r]);
    for (int q = r; q < kRows; ++q) {
      own[r][q] = row[r][depth - q];
      for (int p = 0; p < r; ++p) own[r][q] = fma_(Value(0) - factor[p][r], own[p][q], own[r][q]);
    }
    inverted[r] = inverted_pivot(own[r][r], definite);
    for (int q = r + 1; q < kRows; ++q) factor[r][q] = own[r][q] * inverted[r];
  }
  if constexpr (kRows > 1)
    for_each(team, last + 1 - first, [&](Index i) {
      Value entry[kRows];
      for (int r = 0; r < kRows; ++r) {
        entry[r] = row[r][first + i];
        for (int p = 0; p < r; ++p) entry[r] = fma_(Value(0) - factor[p][r], entry[p], entry[r]);
        if (r > 0) row[r].put(first + i, entry[r]);
      }
    });
  if (team.rank() == 0)  // they are read once all chains are eliminated
    for (int r = 0; r < kRows; ++r) {
      inverse.put(k - r, inverted[r]);
      if (r > 0) row[r].put(depth - r, own[r][r]);
      for (int q = r + 1; q < kRows; ++q)
        if (r > 0 || kScales) row[r].put(depth - q, kScales ? factor[r][q] : own[r][q]);
    }
  const auto* const path = tree.path(k);
  if constexpr (kScales) {
    for (; last > first; last -= 2) eliminate<kRows, 2, true>(tree, H, path, first, last, row, inverted);
    if (last == first) eliminate<kRows, 1, true>(tree, H, path, first, last, row, inverted);
  } else {
    for_each(team, last + 1 - first,
             [&](Index i) { eliminate<kRows, 1, false>(tree, H, path, first, last - i, row, inverted); });
  }
}

/// H = L'DL in place, in the tree's envelope; `inverse` gets D^-1. Rows of L below, the diagonal keeps D. Returns the
/// lanes in which every pivot is positive.
template <Team TeamT, class Set, class Numbers>
STICTION_HD_OUTLINE auto factor_tree(TeamT& team, const DofTree<Set>& tree, const Numbers& H, const Numbers& inverse) {
  using Value = decltype(H[0]);
  Mask<Value> definite = Value(0) == Value(0);
  for_each_chain<kMostChain<TeamT>>(
      tree, [&](auto rows, Index k) { eliminate_chain<decltype(rows)::value>(team, tree, H, inverse, k, definite); });
  if constexpr (!kIsAlone<TeamT>) {
    team.sync();
    for_each(team, tree.dofs, [&](Index k) {
      const Numbers row = H.from(tree.begin[k]);
      const Value inverted = inverse[k];
      for (Index d = tree.first(k); d < tree.depth[k]; ++d) row.put(d, row[d] * inverted);
    });
  }
  return definite;
}

/// sum += amount times the entries that row k has for its ancestors, entry(d) for that of depth d; ends in a sync.
template <Team TeamT, class Set, class Numbers, class Value, class F>
STICTION_HD void add_column(TeamT& team, const DofTree<Set>& tree, Index k, Value amount, F&& entry,
                            const Numbers& sum) {
  const auto* const path = tree.path(k);
  const Index begin = tree.first(k);
  for_each(team, tree.depth[k] - begin, [&](Index i) {
    const Index to = path[begin + i];
    sum.put(to, fma_(entry(begin + i), amount, sum[to]));
  });
}
/// sum = A x of a symmetric A. entry(e): its lower triangle in the tree's envelope. A row adds its column's terms to
/// its ancestors once they have their rows' terms.
template <Team TeamT, class Set, class Numbers, class F, class G>
STICTION_HD void multiply_symmetric(TeamT& team, const DofTree<Set>& tree, F&& entry, G&& x, const Numbers& sum) {
  using Value = decltype(sum[0]);
  for_each(team, tree.dofs, [&](Index k) {
    const auto* const path = tree.path(k);
    Value own = entry(tree.diagonal(k)) * x(k);
    for (Index d = tree.first(k); d < tree.depth[k]; ++d) own = fma_(entry(tree.begin[k] + d), x(path[d]), own);
    sum.put(k, Value(0) + own);
  });
  for (Index k = 0; k < tree.dofs; ++k)
    add_column(team, tree, k, x(k), [&](Index d) { return entry(tree.begin[k] + d); }, sum);
}

/// L becomes L'L in place, L in the tree's envelope: factor_tree undone from the root on.
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
    inverse.put(k, inverted_pivot(row[tree.depth[k]], definite));
  });
  return on_all_lanes(team, definite);
}

/// Takes a chain of kRows rows out of x; ends in a sync. Lanes take an ancestor each, and all of them compute x at the
/// rows.
template <int kRows, Team TeamT, class Set, class Numbers>
STICTION_HD void solve_rows(TeamT& team, const DofTree<Set>& tree, const Numbers& L, const Numbers& x, Index k) {
  using Value = decltype(L[0]);
  Numbers row[kRows];
  Value value[kRows];
  Value minus[kRows];
  const Index depth = tree.depth[k], first = tree.first(k);
  for (int r = 0; r < kRows; ++r) {
    row[r] = L.from(tree.begin[k - r]);
    value[r] = x[k - r];
    for (int q = 0; q < r; ++q) value[r] = fma_(minus[q], row[q][depth - r], value[r]);
    minus[r] = Value(0) - value[r];
  }
  const auto* const path = tree.path(k);
  for_each(team, depth - (kRows - 1) - first, [&](Index i) {
    const Index d = first + i;
    Value sum = x[path[d]];
    for (int r = 0; r < kRows; ++r) sum = fma_(minus[r], row[r][d], sum);
    x.put(path[d], sum);
  });
  if (team.rank() == 0)  // they are read once all rows are done
    for (int r = 1; r < kRows; ++r) x.put(k - r, value[r]);
}

/// x becomes (L'DL)^-1 x  (dofs).
template <Team TeamT, class Set, class Numbers>
STICTION_HD_OUTLINE void solve_tree(TeamT& team, const DofTree<Set>& tree, const Numbers& L, const Numbers& inverse,
                                    const Numbers& x) {
  using Value = decltype(L[0]);
  for_each_chain<kMostChain<TeamT>>(
      tree, [&](auto rows, Index k) { solve_rows<decltype(rows)::value>(team, tree, L, x, k); });
  if constexpr (kIsAlone<TeamT>) {
    for (Index k = 0; k < tree.dofs; ++k) {
      const Numbers row = L.from(tree.begin[k]);
      const auto* const path = tree.path(k);
      Value sum = x[k] * inverse[k];
      for (Index d = tree.first(k); d < tree.depth[k]; ++d) sum = fma_(Value(0) - row[d], x[path[d]], sum);
      x.put(k, sum);
    }
  } else {
    team.sync();
    for_each(team, tree.dofs, [&](Index k) { x.put(k, x[k] * inverse[k]); });
    // A level that is done is taken out of all rows below, in each of which terms have the same order.
    for (Index level = 0; level + 1 < tree.levels; ++level) {
      const Index begin = tree.level_begin[level + 1];
      for_each(team, tree.dofs - begin, [&](Index i) {
        const Index k = tree.by_depth[begin + i];
        x.put(k, fma_(Value(0) - L[tree.begin[k] + level], x[tree.path(k)[level]], x[k]));
      });
    }
  }
}

}  // namespace stiction::inline STICTION_ISA
