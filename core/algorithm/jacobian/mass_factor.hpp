#pragma once

#include "core/base/column_set.hpp"
#include "core/base/row_tile.hpp"
#include "core/team/phases.hpp"
#include "stiction/jacobian.hpp"

/// M = L L' and solutions by it (docs/howto/jacobian.md). A product with a zero may be left out or not, whichever is
/// faster. It could change the sign of a zero only, which reaches no other number, and neither A, Y nor velocities
/// keep it. This takes finite factors; those of L are checked, and any other is in a row that is flagged for it.
namespace stiction::inline STICTION_ISA {

/// A block-diagonal lower triangular matrix: one block makes it dense, blocks of one row make it a diagonal. The rows
/// of a block lie in panels of Tile::kRows. A panel is stored column by column up to its last row's, entries of a
/// column side by side. Factors of a substitution lie below the diagonal, the negative of the entry.
template <class Tile>
struct BlockTriangle {
  using Real = typename Tile::Real;
  static constexpr Index kEdge = Tile::kRows;
  Real* data;
  Index rows;
  Index block;  ///< rows of a block

  struct Panel {
    Index begin;  ///< first row and column of its block
    Index first;  ///< its own first row
    Index count;  ///< rows
    Real* data;
    [[nodiscard]] STICTION_HD Real* column(Index j) const { return data + (j - begin) * kEdge; }
  };

  [[nodiscard]] STICTION_HD Index block_panels() const { return (block + kEdge - 1) / kEdge; }
  [[nodiscard]] STICTION_HD Index panels() const { return rows / block * block_panels(); }
  [[nodiscard]] STICTION_HD Offset panel_elements() const { return static_cast<Offset>(kEdge) * block; }
  [[nodiscard]] STICTION_HD Offset elements() const { return panels() * panel_elements(); }
  [[nodiscard]] STICTION_HD Panel panel(Index q) const {
    const Index which = block == rows ? 0 : q / block_panels();
    const Index begin = which * block, local = (q - which * block_panels()) * kEdge;
    return {begin, begin + local, block - local < kEdge ? block - local : kEdge, data + q * panel_elements()};
  }
};

/// The lower triangle of M into the panels; or a factor that came as M. Returns true if it is a factor: positive on
/// the diagonal, and finite. Numbers that belong to no entry may be anything.
template <class Tile, Team TeamT>
STICTION_HD bool load_mass(TeamT& team, const BlockTriangle<Tile>& L, const Scalar<typename Tile::Wide>* M,
                           MassForm form) {
  using Wide = typename Tile::Wide;
  using Real = typename Tile::Real;
  constexpr Index kEdge = Tile::kRows;
  std::uint32_t broken = 0;
  for_each(team, L.panels(), [&](Index q) {
    const auto panel = L.panel(q);
    const Index left = panel.first - panel.begin;
    const auto row = [&](Index r) { return M + static_cast<Offset>(panel.first + r) * L.block; };
    turn_rows<Tile>(panel.count, left, row, panel.data, kEdge);
    Real* const square = panel.data + left * kEdge;
    for (Index k = 0; k < panel.count * kEdge; ++k) square[k] = 0;
    for (Index r = 0; r < panel.count; ++r)
      for (Index j = 0; j <= r; ++j) square[j * kEdge + r] = row(r)[left + j];
    if (form == MassForm::matrix) return;
    for (Index k = 0; k < (left + panel.count) * kEdge; k += Tile::kLanes) {
      Wide entries;
      load_lanes(panel.data + k, entries);
      broken |= static_cast<std::uint32_t>(any(not_(finite_(entries))));
      store_lanes(panel.data + k, Wide(0) - entries);
    }
    for (Index r = 0; r < panel.count; ++r) {
      Real& diagonal = square[r * kEdge + r];
      diagonal = Real(0) - diagonal;
      broken |= static_cast<std::uint32_t>(!(diagonal > Real(0)));
    }
  });
  return team.combine(broken) == 0;
}

/// Columns [0, count) of a tile that are all but known: each is divided by its pivot and taken out of those behind it.
/// factor: the first column's multipliers, the next one's kRows further on.
template <class Tile>
STICTION_HD void substitute_group(typename Tile::Wide (&sum)[Tile::kLanes][Tile::kVectors],
                                  const typename Tile::Real* factor, Index count) {
  using Wide = typename Tile::Wide;
  for (Index r = 0; r < Tile::kLanes; ++r)
    if (r < count)
      for (Index v = 0; v < Tile::kVectors; ++v) {
        const typename Tile::Real* const column = factor + r * Tile::kRows;
        sum[r][v] = div_(sum[r][v], Wide(column[r]));
        for (Index s = r + 1; s < Tile::kLanes; ++s) sum[s][v] = fma_(Wide(column[s]), sum[r][v], sum[s][v]);
      }
}

/// Pivots of `count` columns of a panel from `group` on, which are rows of it too, and the entries below them in the
/// panel. Returns true if all pivots were positive and finite.
template <class Tile>
STICTION_HD bool factor_group(typename Tile::Real* columns, Index group, Index count) {
  using Wide = typename Tile::Wide;
  using Real = typename Tile::Real;
  for (Index r = 0; r < count; ++r) {
    Real* const column = columns + r * Tile::kRows;
    const Real diagonal = column[group + r];
    if (!(diagonal > Real(0)) || !finite_(diagonal)) return false;
    const Real pivot = sqrt_(diagonal);
    Wide known[Tile::kVectors];
    for (Index v = 0; v < Tile::kVectors; ++v) {
      load_lanes(column + v * Tile::kLanes, known[v]);
      known[v] = div_(known[v], Wide(pivot));
      store_lanes(column + v * Tile::kLanes, Wide(0) - known[v]);
    }
    column[group + r] = pivot;
    for (Index s = r + 1; s < count; ++s)
      for (Index v = 0; v < Tile::kVectors; ++v) {
        Real* const target = columns + s * Tile::kRows + v * Tile::kLanes;
        Wide entry;
        load_lanes(target, entry);
        store_lanes(target, fma_(Wide(column[group + s]), known[v], entry));
      }
  }
  return true;
}

/// Factors M = L L', right-looking, as many columns at a time as a vector has lanes. Entry (i, j) takes its updates in
/// the order of the columns on every machine. Returns true if every pivot was positive and finite, on every lane;
/// otherwise the factor is unfinished. A number that is not finite below the diagonal leaves no such pivot in its row.
template <class Tile, Team TeamT>
STICTION_HD bool factor_mass(TeamT& team, const BlockTriangle<Tile>& L, const Scalar<typename Tile::Wide>* M,
                             MassForm form) {
  using Wide = typename Tile::Wide;
  using Real = typename Tile::Real;
  constexpr Index kEdge = Tile::kRows, kGroup = Tile::kLanes, kVectors = Tile::kVectors;
  if (!load_mass(team, L, M, form)) return false;
  if (form == MassForm::factor) return true;
  const Index panels = L.panels();
  for (Index q = 0; q < panels; ++q) {
    const auto own = L.panel(q);
    const Index first_panel = (own.first - own.begin) / kEdge, below = L.block_panels() - first_panel;
    for (Index group = 0; group < own.count; group += kGroup) {
      const Index count = own.count - group < kGroup ? own.count - group : kGroup;
      Real* const columns = own.column(own.first + group);
      if (!team.broadcast([&] { return factor_group<Tile>(columns, group, count); })) return false;
      // Entries of these columns in panel p below this one, and in columns [from, to) of it.
      const auto entries = [&](Index p) { return columns + p * L.panel_elements(); };
      for_each(team, below - 1, [&](Index p) {
        Real* const mine = entries(p + 1);
        Wide sum[kGroup][kVectors];
        for (Index r = 0; r < kGroup; ++r)
          for (Index v = 0; v < kVectors; ++v) load_lanes(mine + r * kEdge + v * kGroup, sum[r][v]);
        substitute_group<Tile>(sum, columns + group, kGroup);
        for (Index r = 0; r < kGroup; ++r)
          for (Index v = 0; v < kVectors; ++v) store_lanes(mine + r * kEdge + v * kGroup, Wide(0) - sum[r][v]);
      });
      // Its own panel has columns behind these only where vectors are shorter than panels.
      const Index nearest = group + kGroup < own.count ? 0 : 1;
      for_each(team, below - nearest, [&](Index at) {
        const Index p = nearest + at;
        const Real* const mine = entries(p);
        Wide known[kGroup][kVectors];
        Mask<Wide> some = Wide(0) != Wide(0);
        for (Index r = 0; r < kGroup; ++r)
          for (Index v = 0; v < kVectors; ++v) {
            known[r][v] = Wide(0);
            if (r >= count) continue;
            load_lanes(mine + r * kEdge + v * kGroup, known[r][v]);
            known[r][v] = Wide(0) - known[r][v];
            some = or_(some, known[r][v] != Wide(0));
          }
        if (!any(some)) return;
        // Column c of this panel; row c of the factor is in one of the panels up to it.
        Real* target = columns + p * L.panel_elements() + kGroup * kEdge;
        for (Index other = 0; other <= p; ++other) {
          const Real* const factor = entries(other);
          const Index rows =
              L.block - (first_panel + other) * kEdge < kEdge ? L.block - (first_panel + other) * kEdge : kEdge;
          for (Index l = other == 0 ? group + kGroup : 0; l < rows; ++l, target += kEdge)
            for (Index v = 0; v < kVectors; ++v) {
              Wide entry;
              load_lanes(target + v * kGroup, entry);
              for (Index r = 0; r < kGroup; ++r) entry = fma_(Wide(factor[r * kEdge + l]), known[r][v], entry);
              store_lanes(target + v * kGroup, entry);
            }
        }
      });
    }
  }
  return true;
}

/// x = L^-1 x for the rows of a tile, whose entries of column k lie side by side from x + k step on. `full`: the
/// columns in which one of them has anything, before and after.
template <class Tile>
STICTION_HD void substitute(const BlockTriangle<Tile>& L, typename Tile::Real* x, Index step,
                            const ColumnSet<!Tile::kOneRow>& full) {
  using Wide = typename Tile::Wide;
  using Real = typename Tile::Real;
  constexpr Index kGroup = Tile::kLanes, kVectors = Tile::kVectors;
  const Index panels = L.panels();
  if (L.block == 1) {
    full.for_each(0, L.rows, [&](Index k) {
      for (Index v = 0; v < kVectors; ++v) {
        Real* const entries = x + static_cast<Offset>(k) * step + v * Tile::kLanes;
        Wide entry;
        load_lanes(entries, entry);
        store_lanes(entries, div_(entry, Wide(L.data[k * Tile::kRows])));
      }
    });
    return;
  }
  for (Index q = 0; q < panels; ++q) {
    const auto panel = L.panel(q);
    if (!full.any(panel.begin, panel.first + panel.count)) continue;
    for (Index group = 0; group < panel.count; group += kGroup) {
      // Works on as many columns together as there are lanes. A known one is read once for all of them, and their sums
      // do not wait for each other. Entries behind the block's last one are not kept.
      const Index first = panel.first + group;
      const Index count = panel.count - group < kGroup ? panel.count - group : kGroup;
      Real* const own = x + static_cast<Offset>(first) * step;
      Wide sum[kGroup][kVectors];
      for (Index r = 0; r < kGroup; ++r)
        for (Index v = 0; v < kVectors; ++v) {
          sum[r][v] = Wide(0);
          if (r < count) load_lanes(own + static_cast<Offset>(r) * step + v * Tile::kLanes, sum[r][v]);
        }
      full.for_each(panel.begin, first, [&](Index j) {
        const Real* const factor = panel.column(j) + group;
        for (Index v = 0; v < kVectors; ++v) {
          Wide known;
          load_lanes(x + static_cast<Offset>(j) * step + v * Tile::kLanes, known);
          for (Index r = 0; r < kGroup; ++r) sum[r][v] = fma_(Wide(factor[r]), known, sum[r][v]);
        }
      });
      substitute_group<Tile>(sum, panel.column(first) + group, count);
      std::uint64_t some = 0;
      for (Index r = 0; r < kGroup; ++r)
        if (r < count) {
          Mask<Wide> filled = Wide(0) != Wide(0);
          for (Index v = 0; v < kVectors; ++v) {
            store_lanes(own + static_cast<Offset>(r) * step + v * Tile::kLanes, sum[r][v]);
            filled = or_(filled, sum[r][v] != Wide(0));
          }
          some |= static_cast<std::uint64_t>(any(filled)) << r;
        }
      full.assign(first, count, some);
    }
  }
}

/// change = L^-T L^-1 motion; destroys motion. An entry that is known is taken out of all the others at once, so that
/// a step ends when its lanes have. Every lane divides for itself, which saves a step in between.
template <class Tile, Team TeamT>
STICTION_HD void solve_mass(TeamT& team, const BlockTriangle<Tile>& L, typename Tile::Real* motion,
                            typename Tile::Real* change) {
  using Wide = typename Tile::Wide;
  using Real = typename Tile::Real;
  constexpr Index kEdge = Tile::kRows;
  for (Index q = 0; q < L.panels(); ++q) {
    const auto panel = L.panel(q);
    const Index below = L.block_panels() - (panel.first - panel.begin) / kEdge;
    for (Index r = 0; r < panel.count; ++r) {
      const Index k = panel.first + r;
      const Real* const column = panel.column(k);
      const Real known = div_(motion[k], column[r]);
      for_each(team, below, [&](Index p) {
        const Real* const factor = column + p * L.panel_elements();
        Real* const target = motion + panel.first + p * kEdge;
        const Index rows = panel.begin + L.block - panel.first - p * kEdge;
        if (p == 0) change[k] = known;
        if (p > 0 && rows >= kEdge) {
          for (Index v = 0; v < kEdge; v += Tile::kLanes) {
            Wide entry, multiplier;
            load_lanes(target + v, entry);
            load_lanes(factor + v, multiplier);
            store_lanes(target + v, fma_(multiplier, Wide(known), entry));
          }
        } else {
          for (Index l = p == 0 ? r + 1 : 0; l < kEdge && l < rows; ++l) target[l] = fma_(factor[l], known, target[l]);
        }
      });
    }
  }
  for_each(team, L.rows, [&](Index k) { motion[k] = change[k]; });
  for (Index q = L.panels() - 1; q >= 0; --q) {
    const auto panel = L.panel(q);
    for (Index r = panel.count - 1; r >= 0; --r) {
      const Index k = panel.first + r;
      const Real known = div_(motion[k], panel.column(k)[r]);
      for_each(team, k - panel.begin + 1, [&](Index back) {
        const Index i = k - back;
        if (back == 0) {
          change[k] = known;
        } else {
          motion[i] = fma_(panel.column(i)[r], known, motion[i]);
        }
      });
    }
  }
}

}  // namespace stiction::inline STICTION_ISA
