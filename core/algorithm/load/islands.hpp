#pragma once

#include <type_traits>

#include "core/algorithm/load/disjoint_sets.hpp"
#include "core/algorithm/load/held_rows.hpp"
#include "core/algorithm/residual/final_residual.hpp"
#include "core/algorithm/system/cone_slots.hpp"
#include "core/algorithm/system/factor_system.hpp"
#include "core/algorithm/system/sparse_system.hpp"

/// Islands of an environment as its errors see them (docs/math/residual.md): cones that A couples, through others or
/// not. An island's error scale is the largest of its cones' own. It spreads from cone to cone until nothing changes,
/// so no list of islands is made.
namespace stiction::inline STICTION_ISA {

/// Returns true if a block of A has an entry.
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
    if (goes_on && s.residual_weight[cone] > Real(0)) goes_on = f(cone, row, decltype(shape)::kRows);
  });
}

/// One pass: s.island of each cone becomes the largest of those that it is coupled with. Returns true if any has
/// changed. A cone that is coupled with the one of the largest scale, `top`, needs no other.
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
        if (s.island[other] > found &&
            (couples(s, row, rows, column, columns) || couples(s, column, columns, row, rows)))
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
/// Spreads scales by the batch's cones along the stored entries of A. `parent`: scratch, exact up to 2^24 cones in
/// single precision                                                                                           (cones)
template <class Real, class Scales>
STICTION_HD_OUTLINE void spread_along_entries(const EnvView<Real>& env, const Scales& scale, const Scales& parent) {
  const auto of = [&](Index cone) -> Real& { return parent[cone]; };
  for (Index cone = 0; cone < env.cone_count; ++cone) of(cone) = static_cast<Real>(cone);
  for (Index cone = 0; cone < env.cone_count; ++cone) {
    const Index first = env.cone_row(cone);
    for (Index row = first; row < first + env.cone_size(cone); ++row) {
      const Real* const a = env.A + env.row_offsets[row];
      const Index* const column = env.columns(row);
      const Index count = env.entries(row);
      for (Index k = 0, last = -1; k < count; ++k) {
        if (a[k] == Real(0)) continue;
        if (last >= 0 && column[k] >= env.cone_row(last) && column[k] < env.cone_row(last) + env.cone_size(last))
          continue;
        last = cone_of_row(env, column[k]);
        join_sets(of, cone, last);
      }
    }
  }
  raise_to_sets(env.cone_count, scale, of);
}

/// Spreads scales along the columns of its factor. `reach`: scratch                                    (dofs)
template <class Real, class Scales>
STICTION_HD_OUTLINE void spread_along_factor(const EnvView<Real>& env, const Scales& scale, const Scales& parent,
                                             double* reach) {
  const auto of = [&](Index cone) -> Real& { return parent[cone]; };
  for (Index cone = 0; cone < env.cone_count; ++cone) of(cone) = static_cast<Real>(cone);
  for (Index k = 0; k < env.dofs; ++k) reach[k] = -1.0;  // a cone that has the column
  for (Index cone = 0; cone < env.cone_count; ++cone) {
    const Index first = env.cone_row(cone);
    for (Index row = first; row < first + env.cone_size(cone); ++row)
      for (Index k = 0; k < env.dofs; ++k) {
        if (env.factor[static_cast<Offset>(row) * env.dofs + k] == Real(0)) continue;
        if (reach[k] >= 0.0) join_sets(of, cone, static_cast<Index>(reach[k]));
        reach[k] = static_cast<double>(cone);
      }
  }
  raise_to_sets(env.cone_count, scale, of);
}

template <class Real>
STICTION_HD void spread_scales(const SparseSystem<Real>& s, Real) {
  spread_along_entries(*s.env, s.island, s.shares);
}
template <class Real>
STICTION_HD void spread_scales(const FactorSystem<Real>& s, Real) {
  spread_along_factor(*s.env, s.island, s.shares, s.exact);
}

/// The error of a cone whose rows are held, in the solver's units: no reaction changes it.
template <class Real>
STICTION_HD_OUTLINE Real held_error(const EnvView<Real>& env, Index cone, Real scale_b) {
  const ConeBounds bounds = cone_bounds(env, cone);
  return with_shape(env.kind[cone], env.cone_size(cone), [&](auto shape) {
    constexpr int kRows = decltype(shape)::kRows;
    ConeMetric<double, kRows> metric;
    metric.a = 0.0;
    double none[kRows];
    double y[kRows];
    for (int k = 0; k < kRows; ++k) {
      const Index i = env.row_of(env.cone_row(cone), kRows, k);
      const double mu = static_cast<double>(row_scale(env, env.kind[cone], k, i));
      const auto weights = axis_weights(0.0, 0.0, mu);
      metric.press[k] = weights.press;
      metric.slip[k] = weights.slip;
      none[k] = 0.0;
      y[k] = mu * (static_cast<double>(env.b[i]) * static_cast<double>(scale_b));
    }
    const double square = env.law == Law::coulomb
                              ? law_error_square<Law::coulomb>(shape, none, y, metric, bounds.lo, bounds.hi)
                              : law_error_square<Law::convex>(shape, none, y, metric, bounds.lo, bounds.hi);
    return static_cast<Real>(sqrt_(square));
  });
}

/// The scale that shares are of: the largest, or the scale allowed by the smallest one's share. Beyond that ratio the
/// error of a small island would be weighed too little.
template <class Real>
STICTION_HD Real within_reach(Real largest, Real ratio) {
  const Real reach(static_cast<Scalar<Real>>(kIdleIsland<Real>));
  return ratio > reach && finite_(ratio) ? largest * div_(reach, ratio) * Real(0.5) : largest;
}

/// Turns the cones' own error scales, which are in s.island, into shares of the largest island's. A guess in an island
/// that needs nothing is left out. is_held(cone, slot): its rows may be held. No search is for such a cone, whose error
/// would hide that of all others; its share is negative.
template <Team TeamT, class Real, class System, class IsHeld>
STICTION_HD void weigh_islands(TeamT& team, const EnvView<Real>& env, System& s, IsHeld&& is_held) {
  Real own_most(0), own_held(0);
  const Real scale_b = s.scalar[kScaleB];
  for_each_slot(team, env, s, [&](Index cone, ConeSlot slot) {
    if (is_held(cone, slot)) {
      s.island[slot.cone] = Real(0);
      own_held = max_(held_error(env, cone, scale_b), own_held);
    }
    own_most = max_(s.island[slot.cone], own_most);
  });
  const Real of_others = team.max(own_most), of_held = team.max(own_held);
  const Real largest = of_others > Real(0) ? of_others : of_held;
  Real most = largest;
  std::uint32_t differs = 0;
  for_each_slot(team, env, s, [&](Index, ConeSlot slot) { differs |= s.island[slot.cone] != largest ? 1U : 0U; });
  if (team.combine(differs) != 0) {
    single(team, [&] { spread_scales(s, largest); });
    Real ratio(1);
    for_each_slot(team, env, s, [&](Index, ConeSlot slot) {
      const Real scale = s.island[slot.cone];
      if (scale > Real(0)) ratio = max_(div_(largest, scale), ratio);
    });
    most = within_reach(largest, team.max(ratio));
  }
  for_each_slot(team, env, s, [&](Index cone, ConeSlot slot) {
    const Real scale = s.island[slot.cone];
    if (!(scale > Real(0)) && !is_held(cone, slot))
      for (Index k = 0; k < env.cone_size(cone); ++k) s.x[slot.row + k] = Real(0);
    const Real share = most > Real(0) ? island_share(most, scale) : Real(1);
    const bool held = is_held(cone, slot);
    s.island[slot.cone] = held ? Real(0) : share;
    s.shares[cone] = held ? Real(0) - island_share(most, held_error(env, cone, scale_b)) : share;
  });
  if (most > Real(0)) single(team, [&] { s.scalar[kErrorScale] = most; });
  team.sync();
}

/// The shares by the batch's cones, for callers without a system.
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
