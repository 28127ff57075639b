#pragma once

#include "core/base/column_set.hpp"
#include "core/base/row_tile.hpp"
#include "core/block/phases.hpp"
#include "stiction/jacobian.hpp"

/// M = L L' and what is solved by it (docs/jacobian.md). A product with a zero may be left out or not, whichever is
/// faster: it could change the sign of a zero only, which reaches no other number, and neither A, Y nor velocities keep
/// it. That takes finite factors; those of L are looked at, and any other is in a row that is flagged for it.
namespace stiction::inline STICTION_ISA {

/// A block-diagonal lower triangular matrix: one block makes it dense, blocks of one row make it a diagonal. The rows
/// of a block lie in panels of Tile::kRows, each panel column by column up to its last row's, entries of a column side
/// by side. Below the diagonal is what a substitution multiplies by, the negative of the entry.
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

/// The lower triangle of M into the panels, zeros elsewhere; or a factor that came as M. Whether that is one: positive
/// on the diagonal, and finite.
template <class Tile, Block B>
STICTION_HD bool load_mass(B& team, const BlockTriangle<Tile>& L, const Scalar<typename Tile::Wide>* M, MassForm form) {
  using Real = typename Tile::Real;
  std::uint32_t broken = 0;
  for_each(team, L.panels(), [&](Index q) {
    const auto panel = L.panel(q);
    const Index local = panel.first - panel.begin;
    for (Index k = 0; k < (local + panel.count) * Tile::kRows; ++k) panel.data[k] = 0;
    for (Index r = 0; r < panel.count; ++r) {
      const Real* const row = M + static_cast<Offset>(panel.first + r) * L.block;
      Real* const to = panel.data + r;
      if (form == MassForm::matrix) {
        for (Index j = 0; j <= local + r; ++j) to[j * Tile::kRows] = row[j];
      } else {
        for (Index j = 0; j < local + r; ++j) {
          to[j * Tile::kRows] = Real(0) - row[j];
          broken |= static_cast<std::uint32_t>(!finite_(row[j]));
        }
        const Real diagonal = row[local + r];
        to[(local + r) * Tile::kRows] = diagonal;
        broken |= static_cast<std::uint32_t>(!(diagonal > Real(0)) || !finite_(diagonal));
      }
    }
  });
  return team.combine(broken) == 0;
}

/// M = L L', right-looking, column by column: entry (i, j) takes its updates in the order of the columns, whoever makes
/// them. Whether every pivot was positive and finite, on every lane; where one was not the factor is unfinished. A
/// number that is not finite below the diagonal leaves no such pivot in its row.
template <class Tile, Block B>
STICTION_HD bool factor_mass(B& team, const BlockTriangle<Tile>& L, const Scalar<typename Tile::Wide>* M,
                             MassForm form) {
  using Wide = typename Tile::Wide;
  using Real = typename Tile::Real;
  constexpr Index kEdge = Tile::kRows;
  if (!load_mass(team, L, M, form)) return false;
  if (form == MassForm::factor) return true;
  for (Index k = 0; k < L.rows; ++k) {
    const Index begin = L.block == L.rows ? 0 : k - k % L.block;
    const Index own = (k - begin) / kEdge, lane = (k - begin) % kEdge;
    const Index below = L.block_panels() - own;
    Real* const block_data = L.data + (begin / L.block) * L.block_panels() * L.panel_elements();
    Real* const column = block_data + own * L.panel_elements() + (k - begin) * kEdge;
    const Real pivot = team.broadcast([&] {
      const Real diagonal = column[lane];
      return diagonal > Real(0) && finite_(diagonal) ? sqrt_(diagonal) : Real(0);
    });
    if (!(pivot > Real(0))) return false;
    for_each(team, below, [&](Index p) {
      Real* const mine = column + p * L.panel_elements();
      for (Index v = 0; v < kEdge; v += Tile::kLanes) {
        Wide entry;
        load_lanes(mine + v, entry);
        store_lanes(mine + v, Wide(0) - div_(entry, Wide(pivot)));
      }
      if (p == 0) mine[lane] = pivot;
    });
    for_each(team, below, [&](Index p) {
      const Real* const mine = column + p * L.panel_elements();
      Wide known[Tile::kVectors];
      Mask<Wide> full = Wide(0) != Wide(0);
      for (Index v = 0; v < Tile::kVectors; ++v) {
        load_lanes(mine + v * Tile::kLanes, known[v]);
        known[v] = Wide(0) - known[v];
        full = or_(full, known[v] != Wide(0));
      }
      if (!any(full)) return;
      // Column c of this panel, row c of the factor being in one of the panels up to it.
      Real* target = block_data + (own + p) * L.panel_elements();
      for (Index other = own; other <= own + p; ++other) {
        const Real* const factor = block_data + other * L.panel_elements() + (k - begin) * kEdge;
        const Index rows = L.block - other * kEdge < kEdge ? L.block - other * kEdge : kEdge;
        for (Index l = other == own ? lane + 1 : 0; l < rows; ++l)
          for (Index v = 0; v < Tile::kVectors; ++v) {
            Real* const entries = target + (other * kEdge + l) * kEdge + v * Tile::kLanes;
            Wide entry;
            load_lanes(entries, entry);
            store_lanes(entries, fma_(Wide(factor[l]), known[v], entry));
          }
      }
    });
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
  for (Index q = 0; q < panels; ++q) {
    const auto panel = L.panel(q);
    if (!full.any(panel.begin, panel.first + panel.count)) continue;
    for (Index group = 0; group < panel.count; group += kGroup) {
      // As many columns together as there are lanes: a known one is read once for all of them, and their sums do not
      // wait for each other. Behind the block's last one the factor has zeros.
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
      for (Index r = 0; r < kGroup; ++r)
        if (r < count) {
          const Real* const factor = panel.column(first + r) + group;
          Mask<Wide> some = Wide(0) != Wide(0);
          for (Index v = 0; v < kVectors; ++v) {
            const Wide known = div_(sum[r][v], Wide(factor[r]));
            store_lanes(own + static_cast<Offset>(r) * step + v * Tile::kLanes, known);
            some = or_(some, known != Wide(0));
            for (Index s = r + 1; s < kGroup; ++s) sum[s][v] = fma_(Wide(factor[s]), known, sum[s][v]);
          }
          full.put(first + r, any(some));
        }
    }
  }
}

/// change = L^-T L^-1 motion; destroys motion. An entry that is known is taken out of all the others at once, so that
/// a step ends when its lanes have, and every lane divides for itself, which saves a step in between.
template <class Tile, Block B>
STICTION_HD void solve_mass(B& team, const BlockTriangle<Tile>& L, typename Tile::Real* motion,
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
