#pragma once

#include "core/algorithm/derivative/mode_slots.hpp"
#include "core/algorithm/derivative/mode_workspace.hpp"

/// Environments of contacts into the lanes in which they are differentiated.
namespace stiction::inline STICTION_ISA {

/// Lists the batch's rows and cones of an environment's slots in its lane.
template <class Real, int W>
void list_own_rows(const EnvView<Real>& env, const ModeSlots& slots, const ModeWorkspace<Real, W>& s, int lane) {
  Index *const batch_row = s.rows_of(lane), *const cone_row = s.cones_of(lane);
  for (Index r = 0; r < s.n; ++r) batch_row[r] = -1;
  slots.for_each_cone(
      env.cone_count, [&](Index cone) { return env.cone_size(cone); },
      [&](Index cone, Index row) {
        const Index first = env.cone_row(cone);
        cone_row[cone] = row;
        for (Index k = 0; k < env.cone_size(cone); ++k) batch_row[row + k] = first + k;
      });
}

/// Numbers of each environment's rows into lanes; zeros where there are none.
template <class Real, int W>
void load_own_rows(const EnvView<Real>* envs, int count, const Real* numbers, const ModeWorkspace<Real, W>& s,
                   Pack<double, W>* to) {
  for (Index r = 0; r < s.n; ++r) to[r] = Pack<double, W>(0);
  auto* const number = reinterpret_cast<double*>(to);
  for (int l = 0; numbers != nullptr && l < count; ++l) {
    const Index* const batch_row = s.rows_of(l);
    const Real* const own = numbers + envs[l].first_row;
    for (Index r = 0; r < s.n; ++r)
      if (batch_row[r] >= 0) number[Offset{r} * W + l] = static_cast<double>(own[batch_row[r]]);
  }
}

/// A tile of one row of all lanes: from `from` to where its first column goes.
template <class Real, int W>
void deal_tile(const Real* const (&from)[W], Index count, Real* to) {
  constexpr int kEdge = static_cast<int>(kTileEdge<Real>);
  for (int part = 0; part < W; part += kEdge) {
    const Real* edge[kEdge];
    Real turned[kEdge][kEdge];
    for (int l = 0; l < kEdge; ++l) edge[l] = from[(part + l) % W];
    transpose_tile(edge, turned);
    for (Index k = 0; k < count; ++k)
      for (int l = 0; l < (kEdge < W ? kEdge : W); ++l) to[Offset{k} * W + part + l] = turned[k][l];
  }
}

/// A of all environments, whose rows store every column in order, into lanes. In a lane every number has a separate
/// cache line, and each line is visited once for all.
template <class Real, int W>
void load_own_matrices(const EnvView<Real>* envs, int count, const ModeWorkspace<Real, W>& s) {
  for (Index k = 0; k < s.n + s.kLine; ++k) s.zeros[k] = 0;
  for (Index k = 0; k < s.n * W; ++k) s.row[k] = s.zeros;
  PendingLoad<Real> loads[W];
  for (int l = 0; l < count; ++l) {
    loads[l] = {&envs[l], l, 0, envs[l].A + envs[l].row_offsets[0]};
    find_rows(s, loads[l]);
  }
  const Index tiles = cut_columns(s, loads, count);
  for (Index t = 0; t < tiles; ++t) {
    const ColumnTile tile = s.tile[t];
    Index column[W];
    bool is_padded = false;
    for (int l = 0; l < W; ++l) {
      column[l] = l < count ? s.rows_of(l)[tile.first] : -1;
      is_padded = is_padded || (l < count && s.rows_of(l)[tile.first + tile.count - 1] < 0);
    }
    for (Index r = 0; r < s.n; ++r) {
      const Real* from[W];
      for (int l = 0; l < W; ++l) from[l] = column[l] < 0 ? s.zeros : s.row[Offset{r} * W + l] + column[l];
      Real* const to = s.A + (Offset{r} * s.n + tile.first) * W;
      deal_tile<Real, W>(from, tile.count, to);
      for (int l = 0; is_padded && l < count; ++l)
        for (Index k = 0; k < tile.count; ++k)
          if (s.rows_of(l)[tile.first + k] < 0) to[Offset{k} * W + l] = 0;
    }
  }
}

}  // namespace stiction::inline STICTION_ISA
