#pragma once

#include "core/algorithm/load/load_system.hpp"
#include "core/algorithm/pack/lane_rows.hpp"
#include "core/algorithm/pack/weigh_lanes.hpp"
#include "core/algorithm/residual/final_residual.hpp"

/// Environments that enter lanes of a pack together. It does for all at once what load_system() does for one of them.
/// Their numbers are transposed into the lanes as the batch has them, and whatever is computed is computed there.
namespace stiction::inline STICTION_ISA {

/// Returns true if all entries of A are finite.
template <class Real>
bool has_finite_rows(const EnvView<Real>& env) {
  bool finite = true;
  for (Index i = 0; i < env.n; ++i) finite = finite && all_finite(env.A + env.row_offsets[i], env.entries(i));
  return finite;
}

/// Result of a pass over the numbers of all lanes.
template <class Lanes>
struct LanesSeen {
  Mask<Lanes> broken, negative_compliance, negative_friction, crossed_bounds, bad_diagonal, flat, bad_guess;
  Lanes largest_b, largest_diagonal;
};

/// inspect() of all lanes, but for entries of A that are not on the diagonal. In the lanes that are `loading` it
/// leaves bounds and the sum of each cone's diagonal in the system. It marks in inv_cone which cones there are.
template <class Real, int W>
LanesSeen<Pack<Real, W>> inspect_lanes(const DenseSystem<Pack<Real, W>>& pack, const PackWorkspace<Real, W>& workspace,
                                       Mask<Pack<Real, W>> loading) {
  using Lanes = Pack<Real, W>;
  const Lanes zero(0);
  const auto none = zero > zero;
  LanesSeen<Lanes> seen{none, none, none, none, none, none, none, zero, zero};
  const auto note = [](Mask<Lanes>& found, Mask<Lanes> here) { found = or_(found, here); };
  for_each_segment(pack.counts, [&](auto shape, Index count, Index first_cone, Index first_row) {
    constexpr ConeKind kKind = decltype(shape)::kKind;
    constexpr int kRows = decltype(shape)::kRows;
    for (Index c = 0; c < count; ++c) {
      const Index cone = first_cone + c;
      const Index row = first_row + c * kRows;
      const auto exists = workspace.present[row] > zero;
      Lanes sum(0);
      for (int k = 0; k < kRows; ++k) {
        const Index r = row + k;
        const Lanes b = pack.b[r];
        const Lanes diagonal = workspace.diagonal[r];
        note(seen.broken, not_(and_(finite_(b), finite_(workspace.compliance[r]))));
        note(seen.negative_compliance, workspace.compliance[r] < zero);
        note(seen.bad_guess, not_(can_start_from(pack.x[r])));
        if (k > 0) {
          note(seen.broken, not_(finite_(workspace.scale[r])));
          note(seen.negative_friction, workspace.scale[r] < zero);
        }
        if (kKind != ConeKind::free) note(seen.bad_diagonal, diagonal < zero);
        if (kKind == ConeKind::free || k == 0) note(seen.flat, and_(exists, diagonal == zero));
        if (kKind == ConeKind::box)
          seen.largest_b = max_(lack_of(workspace.lo[cone], workspace.hi[cone], diagonal), seen.largest_b);
        sum = sum + diagonal;
        seen.largest_b = max_(abs_(b), seen.largest_b);
        seen.largest_diagonal = max_(abs_(diagonal), seen.largest_diagonal);
      }
      const Lanes lo = workspace.lo[cone];
      const Lanes hi = workspace.hi[cone];
      if (kKind == ConeKind::box) {
        note(seen.broken, or_(lo != lo, hi != hi));
        note(seen.crossed_bounds, lo > hi);
      }
      pack.residual_weight[cone] = select(loading, sum, pack.residual_weight[cone]);
      pack.inv_cone[cone] = select(loading, workspace.present[row], pack.inv_cone[cone]);
      pack.lo[cone] = select(loading, lo, pack.lo[cone]);
      pack.hi[cone] = select(loading, hi, pack.hi[cone]);
    }
  });
  return seen;
}

/// One lane of it. `finite`: as gather_rows() found.
template <class Real, int W>
Inspection<Real> inspection_of(const LanesSeen<Pack<Real, W>>& seen, const EnvView<Real>& env,
                               const DenseSystem<Real, W>& s, int lane, bool finite) {
  std::uint32_t flags = env.flags;
  const auto flag = [&](bool found, std::uint32_t bit) { flags |= found ? bit : 0U; };
  flag(!finite || is_set(seen.broken, lane), kFlagNonFiniteInput);
  flag(is_set(seen.negative_compliance, lane), kFlagNegativeCompliance);
  flag(is_set(seen.negative_friction, lane), kFlagNegativeFriction);
  flag(is_set(seen.crossed_bounds, lane), kFlagCrossedBounds);
  flag(is_set(seen.bad_diagonal, lane), kFlagBadDiagonal);
  flag(is_set(seen.bad_guess, lane), kFlagWarmStartRejected);
  if (is_set(seen.flat, lane)) flags |= look_at_flat_rows(env, s);
  return {flags & ~kHoldsRows, seen.largest_b.v[lane], seen.largest_diagonal.v[lane], (flags & kHoldsRows) != 0};
}

/// Some columns of every row from rows that lie in memory into lanes, scaled. A part of a line of lanes at a time: as
/// many as a tile has rows.
template <class Real, int W>
struct TileTransposer {
  static constexpr Index kEdge = kTileEdge<Real>;
  using Part = Pack<Real, kEdge>;
  using PartMask = Mask<Part>;

  const PackWorkspace<Real, W>& workspace;
  int part;          ///< first of the lanes
  Real* A;           ///< the pack's matrix                                 (n * n; W)
  Part by;           ///< common factor, beside factors of row and column
  PartMask loading;  ///< lanes that change
  Part poison;       ///< zero where all that was read is finite

  [[nodiscard]] Part of(const Pack<Real, W>* lanes) const {
    Part values;
    load_lanes(reinterpret_cast<const Real*>(lanes) + part, values);
    return values;
  }
  /// The first `count` columns of a tile whose rows begin at from[l]. kPadded: in some lane some are no columns of its
  /// own. kAll: all lanes enter.
  template <bool kPadded, bool kAll>
  void transpose(const Real* const (&from)[kEdge], Index row, Index first_column, Index count) {
    Real turned[kEdge][kEdge];
    transpose_tile(from, turned);
    const Part zero(0);
    const Part of_row = of(workspace.factor + row);
    const auto put = [&](Index k) {
      const Index column = first_column + k;
      Part value;
      load_lanes(turned[k], value);
      if constexpr (kPadded) value = select(of(workspace.present + column) > zero, value, zero);
      poison = fma_(value, zero, poison);
      value = zero + (value * by) * (of_row * of(workspace.factor + column));
      Real* const line = A + (row + Offset{workspace.n} * column) * W + part;
      if constexpr (!kAll) {
        Part old;
        load_lanes(line, old);
        value = select(loading, value, old);
      }
      store_lanes(line, value);
    };
    if (count == kEdge) {
      for (Index k = 0; k < kEdge; ++k) put(k);
    } else {
      for (Index k = 0; k < count; ++k) put(k);
    }
  }
  /// All tiles of all rows.
  template <bool kPadded, bool kAll>
  void transpose_rows(Index tile_count) {
    for (Index r = 0; r < workspace.n; ++r)
      for (Index t = 0; t < tile_count; ++t) {
        const Real* from[kEdge];
        for (Index l = 0; l < kEdge; ++l)
          from[l] = workspace.row[r * W + part + l] + workspace.column[t * W + part + l];
        transpose<kPadded, kAll>(from, r, workspace.tile[t].first, workspace.tile[t].count);
      }
  }
};

/// The matrices of the environments being loaded, each into its lane and scaled there. In a lane every number has a
/// separate cache line, and each line is visited once for all. Returns in which lanes a number is not finite.
template <class Real, int W>
Mask<Pack<Real, W>> transpose_into_lanes(const DenseSystem<Pack<Real, W>>& pack,
                                         const PackWorkspace<Real, W>& workspace, const PendingLoad<Real>* loads,
                                         int count, const Pack<Real, W>& scale_a, const Pack<Real, W>& loading_mark) {
  using Transposer = TileTransposer<Real, W>;
  constexpr Index kEdge = Transposer::kEdge;
  const Index n = pack.n;
  for (Index k = 0; k < n + PackWorkspace<Real, W>::kLine; ++k) workspace.zeros[k] = 0;
  for (Index k = 0; k < n * W; ++k) workspace.row[k] = workspace.zeros;
  bool is_padded = false;
  for (int e = 0; e < count; ++e) {
    find_rows(workspace, loads[e]);
    const auto factor = PackWorkspace<Real, W>::lane_of(workspace.factor, loads[e].lane);
    const auto scale = PackWorkspace<Real, W>::lane_of(workspace.scale, loads[e].lane);
    for (Index r = 0; r < n; ++r) factor[r] = loads[e].is_scaled ? Real(1) : scale[r];
    is_padded = is_padded || loads[e].env->n != n;
  }
  const Index tile_count = cut_columns(workspace, loads, count);
  for (Index k = 0; k < tile_count * W; ++k) workspace.column[k] = 0;
  for (int e = 0; e < count; ++e)
    for (Index t = 0; t < tile_count; ++t) {
      const Index first = workspace.tile[t].first;
      const Index i = workspace.rows_of(loads[e].lane)[first];
      workspace.column[t * W + loads[e].lane] = loads[e].is_written ? first : i >= 0 ? i : 0;
    }
  auto broken = Pack<Real, W>(0) > Pack<Real, W>(0);
  for (int part = 0; part < W; part += static_cast<int>(kEdge)) {
    Transposer transposer{workspace, part, reinterpret_cast<Real*>(pack.A.data), {}, {}, typename Transposer::Part(0)};
    transposer.by = transposer.of(&scale_a);
    transposer.loading = transposer.of(&loading_mark) > typename Transposer::Part(0);
    if (!any(transposer.loading)) continue;
    const bool is_all = !any(not_(transposer.loading));
    if (is_padded) {
      is_all ? transposer.template transpose_rows<true, true>(tile_count)
             : transposer.template transpose_rows<true, false>(tile_count);
    } else {
      is_all ? transposer.template transpose_rows<false, true>(tile_count)
             : transposer.template transpose_rows<false, false>(tile_count);
    }
    const auto broken_here = transposer.poison != typename Transposer::Part(0);
    for (Index l = 0; l < kEdge; ++l) broken.v[part + l] = broken_here.v[l];
  }
  return broken;
}

/// In which lanes A is too far from symmetric for a method that minimises.
template <class Lanes>
Mask<Lanes> asymmetric_lanes(const DenseSystem<Lanes>& pack) {
  Lanes largest(0);
  Lanes difference(0);
  for (Index j = 0; j < pack.n; ++j)
    for (Index i = 0; i < pack.n; ++i) {
      const Lanes entry = pack.A[i + Offset{pack.n} * j];
      largest = max_(abs_(entry), largest);
      difference = max_(abs_(entry - pack.A[j + Offset{pack.n} * i]), difference);
    }
  return and_(largest > Lanes(0), div_(difference, largest) > Lanes(kLargestAsymmetry));
}

/// hold_cone() of all cones of a lane whose rows are in place.
template <class Real, int W>
void hold_lane(const EnvView<Real>& env, DenseSystem<Real, W> s) {
  SerialTeam team;
  const LoadScales<Real> scales = load_scales(s);
  for_each_slot(team, env, s, [&](Index cone, ConeSlot slot) {
    if (const unsigned held = held_rows(env, cone); held != 0) hold_cone(env, s, cone, slot, held, scales);
  });
}

/// load_system() of all entrants; their flags mark those that have entered. The others leave numbers of no account.
template <class Real, int W>
STICTION_HD_SHARED void load_lanes_of(const DenseSystem<Pack<Real, W>>& pack, const DenseSystem<Real, W>* lanes,
                                      const PackWorkspace<Real, W>& workspace, LoadRules rules,
                                      PendingLoad<Real>* loads, int count) {
  using Lanes = Pack<Real, W>;
  const auto is_sound = [](std::uint32_t flags) { return (flags & ~kHarmlessFlags) == 0; };
  Lanes loading_mark(0);
  for (int e = 0; e < count; ++e) {
    const int lane = loads[e].lane;
    loading_mark.v[lane] = Real(1);
    gather_rows(loads[e], lanes[lane], workspace);
  }
  sum_diagonals(lanes, workspace, loads, count);
  const LanesSeen<Lanes> looked = inspect_lanes(pack, workspace, loading_mark > Lanes(0));
  Lanes scale_a(1);
  PendingLoad<Real> sound[W];
  bool holds_rows[W] = {};
  int sound_count = 0;
  for (int e = 0; e < count; ++e) {
    PendingLoad<Real>& load = loads[e];
    const EnvView<Real>& env = *load.env;
    const int lane = load.lane;
    const DenseSystem<Real, W>& s = lanes[lane];
    const Inspection<Real> seen = inspection_of<Real, W>(looked, env, s, lane, !load.is_scaled || has_finite_rows(env));
    load.flags = rules.takes_any_diagonal ? seen.flags & ~kFlagBadDiagonal : seen.flags;
    if (!is_sound(load.flags)) {
      if (!has_finite_rows(env)) load.flags |= kFlagNonFiniteInput;
      loading_mark.v[lane] = 0;
      continue;
    }
    start_scalars(s, seen);
    if (env.warm_start != nullptr && !takes_warm_start(env, seen))
      for (Index r = 0; r < s.n; ++r) s.x[r] = 0;
    if (load.is_scaled) {
      const auto scale = PackWorkspace<Real, W>::lane_of(workspace.scale, lane);
      write_rows(env, s.n, workspace.rows_of(lane), &scale, s.scalar[kScaleA], workspace.column,
                 workspace.written + Offset{s.n} * s.n * lane);
    } else {
      scale_a.v[lane] = s.scalar[kScaleA];
    }
    holds_rows[lane] = seen.holds_rows;
    sound[sound_count++] = load;
  }
  weigh_cones(pack.counts, workspace, loading_mark);
  for (int e = 0; e < sound_count; ++e) {
    const EnvView<Real>& env = *sound[e].env;
    if (sound[e].is_scaled) weigh_cones_of(env, pack.counts, workspace, sound[e].lane);
    if (env.counts.free > 0) weigh_bare_rows(env, pack.counts, workspace, sound[e].lane);
  }
  const auto broken = transpose_into_lanes(pack, workspace, sound, sound_count, scale_a, loading_mark);
  const auto loading = loading_mark > Lanes(0);
  const LoadScales<Lanes> scales = load_scales(pack);
  for (Index r = 0; r < pack.n; ++r) {
    Lanes& diagonal = pack.A[r + Offset{pack.n} * r];
    const Lanes scale = workspace.scale[r];
    diagonal = select(loading, diagonal + (workspace.compliance[r] * scales.a) * (scale * scale), diagonal);
  }
  for (int e = 0; e < sound_count; ++e)
    if (const int lane = sound[e].lane; holds_rows[lane]) hold_lane(*sound[e].env, lanes[lane]);
  auto asymmetric = Lanes(0) > Lanes(0);
  if (rules.needs_symmetry) asymmetric = asymmetric_lanes(pack);
  for (int e = 0; e < count; ++e) {
    PendingLoad<Real>& load = loads[e];
    if (!is_sound(load.flags)) continue;
    if (!load.is_scaled && is_set(broken, load.lane)) {
      load.flags |= kFlagNonFiniteInput;
    } else if (is_set(asymmetric, load.lane)) {
      load.flags |= kFlagAsymmetric;
    }
  }
}

/// The systems of the lanes of `loading`, but for their islands.
template <class Real, int W>
STICTION_HD_SHARED void finish_lanes(DenseSystem<Pack<Real, W>>& pack, const PackWorkspace<Real, W>& workspace,
                                     Mask<Pack<Real, W>> loading, Law law) {
  SerialTeam team;
  const auto scales = load_scales(pack);
  for (Index r = 0; r < pack.n; ++r) pack.best[r] = select(loading, workspace.scale[r], pack.best[r]);
  pack.for_each_cone(team, [&](auto shape, Index cone, Index row) {
    finish_cone(shape, pack, cone, row, scales, loading, law, false);
  });
}

/// Completes their loading, but for the record of their first iterates. The lanes' islands are weighed.
template <class Real, int W>
STICTION_HD_SHARED void start_lanes(DenseSystem<Pack<Real, W>>& pack, const PackWorkspace<Real, W>& workspace,
                                    const DenseSystem<Real, W>* lanes, const EnvView<Real>* const* envs,
                                    const int* loaded, int count, Mask<Pack<Real, W>> loading) {
  SerialTeam team;
  for (int k = 0; k < count; ++k) {
    DenseSystem<Real, W> s = lanes[loaded[k]];
    const int lane = loaded[k];
    weigh_islands(team, *envs[k], s, [&](Index cone, ConeSlot slot) {
      return !(workspace.press[Offset{slot.cone} * W + lane] > 0.0) && held_rows(*envs[k], cone) != 0;
    });
    const auto share = PackWorkspace<Real, W>::lane_of(workspace.share, loaded[k]);
    for (Index c = 0; c < s.cones; ++c) share[c] = Real(0);
    for_each_slot(team, *envs[k], s, [&](Index cone, ConeSlot slot) { share[slot.cone] = s.shares[cone]; });
  }
  refresh_motion(team, pack, loading);
  for_each(team, pack.n, [&](Index i) { pack.best[i] = select(loading, pack.x[i], pack.best[i]); });
}

}  // namespace stiction::inline STICTION_ISA
