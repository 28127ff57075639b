#pragma once

#include <type_traits>

#include "core/algorithm/residual/final_residual.hpp"
#include "core/algorithm/system/cone_slots.hpp"
#include "core/algorithm/system/factor_system.hpp"
#include "core/algorithm/system/sparse_system.hpp"

/// Islands of an environment as its errors see them (docs/math/residual.md): cones that A couples, through others or
/// not. An island's error scale is the largest of its cones' own. It spreads from cone to cone until nothing changes, so
/// no list of islands is made.
namespace stiction::inline STICTION_ISA {

/// Whether a block of A has an entry.
template <class Real, int kStride>
STICTION_HD bool couples(const DenseSystem<Real, kStride>& s, Index row, Index rows, Index column, Index columns) {
  for (Index j = column; j < column + columns; ++j)
    for (Index i = row; i < row + rows; ++i)
      if (s.A[i + s.n * j] != Real(0)) return true;
  return false;
}

/// f(cone, row, rows) for the cones of one lane; false ends it.
template <class Real, int kStride, class F>
STICTION_HD void for_each_own(const DenseSystem<Real, kStride>& s, F&& f) {
  bool goes_on = true;
  s.for_each_in_order([&](auto shape, Index cone, Index row) {
    if (goes_on && s.inv_cone[cone] > Real(0)) goes_on = f(cone, row, decltype(shape)::kRows);
  });
}

/// One pass: s.island of each cone becomes the largest of those that it is coupled with. Whether any has changed. A
/// cone that is coupled with the one of the largest scale, `top`, needs no other.
template <class Real, int kStride>
STICTION_HD bool spread_scales(const DenseSystem<Real, kStride>& s, Real most, ConeSlot top, Index top_rows) {
  bool has_changed = false;
  for_each_own(s, [&](Index cone, Index row, Index rows) {
    const Real own = s.island[cone];
    if (own == most) return true;
    Real found = own;
    if (couples(s, row, rows, top.row, top_rows) || couples(s, top.row, top_rows, row, rows)) {
      found = most;
    } else {
      for_each_own(s, [&](Index other, Index column, Index columns) {
        if (s.island[other] > found && (couples(s, row, rows, column, columns) || couples(s, column, columns, row, rows)))
          found = s.island[other];
        return found != most;
      });
    }
    s.island[cone] = found;
    has_changed = has_changed || found != own;
    return true;
  });
  return has_changed;
}
template <class Real, int kStride>
STICTION_HD_OUTLINE void spread_scales(const DenseSystem<Real, kStride>& s, Real most) {
  ConeSlot top{-1, 0};
  Index top_rows = 0;
  for_each_own(s, [&](Index cone, Index row, Index rows) {
    if (s.island[cone] != most) return true;
    top = {cone, row};
    top_rows = rows;
    return false;
  });
  while (top.cone >= 0 && spread_scales(s, most, top, top_rows)) {
  }
}

/// The cone of a row.
template <class Real>
STICTION_HD Index cone_of_row(const EnvView<Real>& env, Index row) {
  Index first = 0, end = env.cone_count;
  while (end - first > 1) {
    const Index middle = first + (end - first) / 2;
    if (env.cone_row(middle) <= row) {
      first = middle;
    } else {
      end = middle;
    }
  }
  return first;
}
/// Spreads scales by the batch's cones along the stored entries of A.
template <class Real, class Scales>
STICTION_HD_OUTLINE void spread_along_entries(const EnvView<Real>& env, const Scales& scale) {
  bool has_changed = true;
  while (has_changed) {
    has_changed = false;
    for (Index cone = 0; cone < env.cone_count; ++cone) {
      const Index first = env.cone_row(cone);
      const auto visit = [&](auto&& f) {
        for (Index row = first; row < first + env.cone_size(cone); ++row) {
          const Real* const a = env.A + env.row_offsets[row];
          const Index* const column = env.columns(row);
          const Index count = env.entries(row);
          for (Index k = 0, last = -1; k < count; ++k) {
            if (a[k] == Real(0)) continue;
            if (last < 0 || column[k] < env.cone_row(last) || column[k] >= env.cone_row(last) + env.cone_size(last))
              last = cone_of_row(env, column[k]);
            f(last);
          }
        }
      };
      auto found = scale[cone];
      visit([&](Index other) { found = max_(scale[other], found); });
      has_changed = has_changed || found != scale[cone];
      scale[cone] = found;
      visit([&](Index other) {
        has_changed = has_changed || scale[other] != found;
        scale[other] = found;
      });
    }
  }
}

/// The same along the columns of its factor. `reach`: scratch                       (dofs)
template <class Real, class Scales>
STICTION_HD_OUTLINE void spread_along_factor(const EnvView<Real>& env, const Scales& scale, double* reach) {
  const auto visit = [&](Index cone, auto&& f) {
    const Index first = env.cone_row(cone);
    for (Index row = first; row < first + env.cone_size(cone); ++row)
      for (Index k = 0; k < env.dofs; ++k)
        if (env.factor[static_cast<Offset>(row) * env.dofs + k] != Real(0)) f(k);
  };
  bool has_changed = true;
  while (has_changed) {
    has_changed = false;
    for (Index k = 0; k < env.dofs; ++k) reach[k] = 0.0;
    for (Index cone = 0; cone < env.cone_count; ++cone)
      visit(cone, [&](Index k) { reach[k] = max_(static_cast<double>(scale[cone]), reach[k]); });
    for (Index cone = 0; cone < env.cone_count; ++cone)
      visit(cone, [&](Index k) {
        if (!(reach[k] > static_cast<double>(scale[cone]))) return;
        scale[cone] = static_cast<std::remove_cvref_t<decltype(scale[cone])>>(reach[k]);
        has_changed = true;
      });
  }
}

template <class Real>
STICTION_HD void spread_scales(const SparseSystem<Real>& s, Real) {
  spread_along_entries(*s.env, s.island);
}
template <class Real>
STICTION_HD void spread_scales(const FactorSystem<Real>& s, Real) {
  spread_along_factor(*s.env, s.island, s.exact);
}

/// Turns the cones' own error scales, which are in s.island, into shares of the largest island's. A guess in an island
/// that needs nothing is left out.
template <Team TeamT, class Real, class System>
STICTION_HD void weigh_islands(TeamT& team, const EnvView<Real>& env, System& s) {
  Real own_most(0);
  for_each_slot(team, env, s, [&](Index, ConeSlot slot) { own_most = max_(s.island[slot.cone], own_most); });
  const Real most = team.max(own_most);
  std::uint32_t differs = 0;
  for_each_slot(team, env, s, [&](Index, ConeSlot slot) { differs |= s.island[slot.cone] != most ? 1U : 0U; });
  if (team.combine(differs) != 0) single(team, [&] { spread_scales(s, most); });
  for_each_slot(team, env, s, [&](Index cone, ConeSlot slot) {
    const Real scale = s.island[slot.cone];
    if (!(scale > Real(0)))
      for (Index k = 0; k < env.cone_size(cone); ++k) s.x[slot.row + k] = Real(0);
    const Real share = most > Real(0) ? island_share(most, scale) : Real(1);
    // A contact that cannot move is not searched for: its error stays, and would hide that of all others.
    const bool is_stuck = env.kind[cone] != ConeKind::free && !(s.press[slot.cone] > Real(0));
    s.island[slot.cone] = is_stuck ? Real(0) : share;
    s.shares[cone] = is_stuck ? Real(0) - share : share;
  });
  if (most > Real(0)) single(team, [&] { s.scalar[kErrorScale] = most; });
  team.sync();
}

/// The shares by the batch's cones, for who knows no system.
template <class Real>
struct IslandShares {
  const Real* data;
  Offset stride;
  STICTION_HD double operator()(Index cone) const { return static_cast<double>(data[cone * stride]); }
};
template <class Real, int kStride>
STICTION_HD IslandShares<Real> island_shares(const SystemArrays<Real, kStride>& s) {
  return {s.shares.data, kStride};
}

/// The error scale of an environment that is loaded, in its own units.
template <class Real, int kStride>
STICTION_HD ErrorScale error_scale_of(const SystemArrays<Real, kStride>& s) {
  return error_scale(div_(static_cast<double>(s.scalar[kErrorScale]), static_cast<double>(s.scalar[kScaleB])));
}

}  // namespace stiction::inline STICTION_ISA
