#pragma once

#include "core/base/pack.hpp"
#include "core/body/prepare_body.hpp"

/// Environments that enter lanes of a pack: each one's numbers are read and scaled where they lie together, and all
/// that is computed from them after that (step lengths, first motion, first residual) is computed in all lanes at once.
namespace stiction::inline STICTION_ISA {

/// Where the matrix of one environment is made before it is dealt into its lane: row by row, in the order and with the
/// padding of the lane.
template <class Real>
struct LaneRows {
  Real* A;       ///< A + diag R in the solver's coordinates                             (n * n of the lane)
  Real* scale;   ///< of each of the lane's rows                                         (n of the lane)
  Index* place;  ///< in the lane, of each of the environment's rows                     (n)
  Index* end;    ///< of each row at which a run of neighbours in the lane begins: its end (n)

  /// For `count` environments: their matrices one behind the other, then all else, which one at a time needs.
  static constexpr Offset elements(Offset n, Offset count) { return count * n * n + 3 * n; }
  /// For number k of `count` environments.
  LaneRows(Real* memory, Offset n, Offset count, Offset k) : A(memory + k * n * n) {
    scale = memory + count * n * n;
    place = reinterpret_cast<Index*>(scale + n);
    end = place + n;
  }
};

/// to[j] = a[j] scaled. What is left behind the last whole tile is done once more with its neighbours before.
template <class Real>
void scale_row(const Real* a, const Real* scale, Index n, Real scale_a, Real of_row, Real* to) {
  constexpr Index kTile = kTileEdge<Real>;
  const auto scaled = [](auto value, auto by, auto row, auto column) {
    return decltype(value)(0) + (value * by) * (row * column);
  };
  if (n < kTile) {
    for (Index j = 0; j < n; ++j) to[j] = scaled(a[j], scale_a, of_row, scale[j]);
    return;
  }
  using Tile = Pack<Real, kTile>;
  const auto scale_tile = [&](Index j) {
    Tile value;
    Tile column;
    load_lanes(a + j, value);
    load_lanes(scale + j, column);
    store_lanes(to + j, scaled(value, Tile(scale_a), Tile(of_row), column));
  };
  Index j = 0;
  for (; j + kTile <= n; j += kTile) scale_tile(j);
  if (j < n) scale_tile(n - kTile);
}

/// A + diag R by rows, from scales and places that are there already. The same operations as assemble(). `n`: the
/// lane's rows.
template <class Real>
void assemble_rows(const EnvView<Real>& env, Index n, Real scale_a, const LaneRows<Real>& rows) {
  // Rows stored in full write every entry of a lane without padding.
  if (!env.is_full || env.n != n)
    for (Index k = 0; k < n * n; ++k) rows.A[k] = 0;
  for (Index i = 0; i < env.n; ++i) {
    Real* const to = rows.A + Offset{n} * rows.place[i];
    const Real* const a = env.A + env.row_offsets[i];
    const Real of_row = rows.scale[rows.place[i]];
    const Index count = env.entries(i);
    if (count == env.n && is_run(env, i)) {
      for (Index j = 0; j < count; j = rows.end[j])
        scale_row(a + j, rows.scale + rows.place[j], rows.end[j] - j, scale_a, of_row, to + rows.place[j]);
    } else {
      const Index* const column = env.columns(i);
      for (Index t = 0; t < count; ++t) {
        Real& entry = to[rows.place[column[t]]];
        entry = entry + (a[t] * scale_a) * (of_row * rows.scale[rows.place[column[t]]]);
      }
    }
    Real& diagonal = to[rows.place[i]];
    diagonal = diagonal + (env.R[i] * scale_a) * (of_row * of_row);
  }
}

/// The matrices that were made, each into its lane: in a lane every number has a cache line of its own, and each line
/// is visited once for all. `made`: n * n numbers of each of `count` environments; `lanes`: of each of them, ascending;
/// `A`: the pack's.
template <class Real, int W>
void deal_matrices(const Real* made, const int* lanes, int count, Index n, Real* A) {
  constexpr Index kEdge = kTileEdge<Real>;
  static_assert(W % kEdge == 0);
  for (int k = 0; k < count;) {
    // Those who go into the same part of a line.
    const int part = lanes[k] / kEdge * kEdge;
    const Real* from[kEdge];
    Real enters[kEdge];
    for (Index r = 0; r < kEdge; ++r) {
      from[r] = made;
      enters[r] = 0;
    }
    for (; k < count && lanes[k] < part + kEdge; ++k) {
      from[lanes[k] - part] = made + Offset{n} * n * k;
      enters[lanes[k] - part] = 1;
    }
    Pack<Real, kEdge> marked;
    load_lanes(enters, marked);
    const auto entering = marked > Pack<Real, kEdge>(0);
    const auto put = [&](Index i, Index j, const Real* values) {
      Real* const line = A + (i + Offset{n} * j) * W + part;
      Pack<Real, kEdge> fresh;
      Pack<Real, kEdge> old;
      load_lanes(values, fresh);
      load_lanes(line, old);
      store_lanes(line, select(entering, fresh, old));
    };
    for (Index i = 0; i < n; ++i) {
      Index j = 0;
      for (; j + kEdge <= n; j += kEdge) {
        Real turned[kEdge][kEdge];
        transpose_tile(from, turned);
        for (Index c = 0; c < kEdge; ++c) put(i, j + c, turned[c]);
        for (Index r = 0; r < kEdge; ++r) from[r] += kEdge;
      }
      for (; j < n; ++j) {
        Real column[kEdge];
        for (Index r = 0; r < kEdge; ++r) column[r] = *from[r]++;
        put(i, j, column);
      }
    }
  }
}

/// What load_system() does for a system that is a lane of a pack, but for what deal_matrices() and begin_lanes() do for
/// all that enter. Returns the flags; with any but kHarmlessFlags set nobody enters, and the lane holds numbers of no
/// account. `is_laid_out`: the lane last held an environment of the same counts, or none, so its padding is
/// zero.
template <class Real, int kStride>
std::uint32_t load_lane(const EnvView<Real>& env, DenseSystem<Real, kStride>& s, LoadRules rules, bool is_laid_out,
                        const LaneRows<Real>& rows) {
  SerialBlock block;
  if (!is_laid_out) {
    for (Index i = 0; i < s.n; ++i) s.b[i] = 0;
    for (Index c = 0; c < s.cones; ++c) s.lo[c] = s.hi[c] = 0;
  }
  // Whoever was here before may have ended with numbers that are none, in its padding, too.
  for (Index i = 0; i < s.n; ++i) s.x[i] = s.best[i] = 0;
  for (Index c = 0; c < s.cones; ++c) s.trace[c] = s.inv_cone[c] = 0;
  const Inspection<Real> seen = inspect(block, env, s, [&](Index cone, ConePlace place, Index k, Index i) {
    place_row(env, s, cone, place, k, i);
    rows.place[i] = place.row + k;
    rows.scale[place.row + k] = s.best[place.row + k];
  });
  const std::uint32_t flags = rules.takes_any_diagonal ? seen.flags & ~kFlagBadDiagonal : seen.flags;
  if ((flags & ~kHarmlessFlags) != 0) return flags;
  start_scalars(s, seen);
  if (env.warm_start != nullptr && !takes_warm_start(env, seen))
    for (Index i = 0; i < s.n; ++i) s.x[i] = 0;
  for (Index i = 0; i < env.n;) {
    const Index first = i;
    for (++i; i < env.n && rows.place[i] == rows.place[i - 1] + 1;) ++i;
    rows.end[first] = i;
  }
  assemble_rows(env, s.n, s.scalar[kScaleA], rows);
  if (rules.needs_symmetry && asymmetry(block, Strided<Real, 1>{rows.A}, s.n) > Real(kLargestAsymmetry))
    return flags | kFlagAsymmetric;
  return flags;
}

/// What is left to do for the environments that load_lane() has put into the lanes of `entering`, and the record of
/// their first iterates.
template <class Method, Law kLaw, class System>
void begin_lanes(System& pack, Mask<typename System::Real> entering) {
  SerialBlock block;
  const auto scales = load_scales(pack);
  pack.for_each_cone(block,
                     [&](auto shape, Index cone, Index row) { finish_cone(shape, pack, cone, row, scales, entering); });
  refresh_motion(block, pack, entering);
  for_each(block, pack.n, [&](Index i) { pack.best[i] = select(entering, pack.x[i], pack.best[i]); });
  record<Method, kLaw>(block, pack, entering);
}

}  // namespace stiction::inline STICTION_ISA
