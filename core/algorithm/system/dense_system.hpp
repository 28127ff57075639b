#pragma once

#include "core/algorithm/problem/cone_shape.hpp"
#include "core/algorithm/problem/env_view.hpp"
#include "core/algorithm/system/system_arrays.hpp"
#include "core/base/extents.hpp"
#include "core/job/cone_blocks.hpp"
#include "core/team/phases.hpp"
#include "core/team/reduce.hpp"

namespace stiction::inline STICTION_ISA {

/// An environment (or a pack of them) as a dense matrix, cones in canonical order. Motion is maintained by columns. A
/// change of one cone's x is pushed into every row of y at once, so a sweep has no reductions (docs/math/pgs.md).
///
/// Slots beyond an environment's own cones hold zeros; they push zeros, so they change no bit of a real row.
template <class RealType, int kStrideValue = 1>
struct DenseSystem : SystemArrays<RealType, kStrideValue> {
  using Real = RealType;
  static constexpr int kStride = kStrideValue;
  static constexpr bool kMaintainsMotion = true;
  /// True where cones may be swept in blocks. On a GPU a lane with an environment of its own has no registers for it.
  static constexpr bool kTakesBlocks = kStride == 1;

  ConeCounts counts;         ///< cones laid out, padding included
  Index n = 0;               ///< rows laid out
  Index cones = 0;           ///< cones laid out
  Strided<Real, kStride> A;  ///< A + diag R in the solver's coordinates, column-major  (n * n)
  Strided<Real, kStride> K;  ///< the method's own matrix, where it has one             (n * n)

  static Offset elements(const ConeCounts& counts, const Workspace& workspace) {
    const Offset rows = row_count(counts);
    return SystemArrays<Real, kStride>::elements(rows, cone_count(counts), workspace) + rows * rows +
           workspace.square_elements(rows);
  }

  STICTION_HD DenseSystem(const ConeCounts& layout, const Workspace& workspace, Real* memory)
      : counts(layout), n(row_count(layout)), cones(cone_count(layout)) {
    A = this->carve({this->carve_wide(memory, n, workspace)}, n, cones, workspace);
    K = A.from(Offset{n} * n);
  }

  /// Entry (i, j) of the block of the cone at `row`.
  [[nodiscard]] STICTION_HD Real block_entry(Index row, int i, int j) const { return A[row + i + n * (row + j)]; }

  [[nodiscard]] STICTION_HD Strided<Real, kStride> vector(Index k) const { return this->extra.from(Offset{k} * n); }

  /// f(shape, cone, row) for every cone; the calls must not depend on each other.
  template <Team TeamT, class F>
  STICTION_HD void for_each_cone(TeamT& team, F&& f) const {
    for_each_segment(counts, [&](auto shape, Index count, Index first_cone, Index first_row) {
      for (Index k = team.rank(); k < count; k += team.size())
        f(shape, first_cone + k, first_row + k * decltype(shape)::kRows);
    });
    team.sync();
  }

  /// f(shape, cone, row) for every cone, on every lane, in canonical order.
  template <class F>
  STICTION_HD void for_each_in_order(F&& f) const {
    for_each_segment(counts, [&](auto shape, Index count, Index first_cone, Index first_row) {
      for (Index k = 0; k < count; ++k) f(shape, first_cone + k, first_row + k * decltype(shape)::kRows);
    });
  }

  /// f(shape, count, cone, row) for every window of up to kMostBlockRows rows of `count` cones of one shape, on every
  /// lane, in canonical order. Padding comes last of each shape: it moves no window.
  template <class F>
  STICTION_HD void for_each_window(F&& f) const {
    for_each_segment(counts, [&](auto shape, Index count, Index first_cone, Index first_row) {
      constexpr Index kRows = decltype(shape)::kRows, kMost = kMostBlockRows / kRows;
      for (Index k = 0; k < count; k += kMost)
        f(shape, smaller_of(count - k, kMost), first_cone + k, first_row + k * kRows);
    });
  }

  /// The sum of f(shape, cone, row) over all cones. Leaves are dealt out within each kind, so padding adds zeros to a
  /// leaf and never moves a term to another.
  template <Team TeamT, class F>
  STICTION_HD Real sum_over_cones(TeamT& team, F&& f) const {
    return sum_leaves<Real>(team, [&](Index leaf) {
      Real sum(0);
      for_each_segment(counts, [&](auto shape, Index count, Index first_cone, Index first_row) {
        for (Index k = leaf; k < count; k += kReduceLeaves)
          sum = sum + f(shape, first_cone + k, first_row + k * decltype(shape)::kRows);
      });
      return sum;
    });
  }

  /// store(i, base(i) + row i of (A + diag R) in), each row summed over columns from the left; with |A| on request.
  template <bool kAbsolute = false, Team TeamT, class Base, class Store>
  STICTION_HD void multiply(TeamT& team, Strided<Real, kStride> in, Base&& base, Store&& store) const {
    constexpr Index kTile = TeamT::kRowTile;
    for_each(team, (n + kTile - 1) / kTile, [&](Index tile) {
      const Index first = tile * kTile;
      if (first + kTile <= n) {
        Real sum[kTile];
        for (Index k = 0; k < kTile; ++k) sum[k] = base(first + k);
        for (Index j = 0; j < n; ++j) {
          const Real factor = in[j];
          const Strided<Real, kStride> a = A.from(first + Offset{n} * j);
          for (Index k = 0; k < kTile; ++k) sum[k] = fma_(kAbsolute ? abs_(a[k]) : a[k], factor, sum[k]);
        }
        for (Index k = 0; k < kTile; ++k) store(first + k, sum[k]);
      } else {
        for (Index i = first; i < n; ++i) {
          Real sum = base(i);
          for (Index j = 0; j < n; ++j) sum = fma_(kAbsolute ? abs_(A[i + n * j]) : A[i + n * j], in[j], sum);
          store(i, sum);
        }
      }
    });
  }

  /// y += A[:, row .. row+M) * d: the push of one cone's change.
  template <int M, Team TeamT>
  STICTION_HD void push(TeamT& team, Index row, const Real (&d)[M]) const {
    const Strided<Real, kStride> columns = A.from(Offset{n} * row);
    for_each(team, n, [&](Index i) {
      Real motion = this->y[i];
      for (int k = 0; k < M; ++k) motion = fma_(columns[i + n * k], d[k], motion);
      this->y[i] = motion;
    });
  }

  /// y[i] += A[i, row .. row+M) * d for the rows i in [first, end).
  template <int M>
  STICTION_HD void push_rows(Index first, Index end, Index row, const Real* d) const {
    const Strided<Real, kStride> columns = A.from(Offset{n} * row);
    for (Index i = first; i < end; ++i) {
      Real motion = this->y[i];
      for (int k = 0; k < M; ++k) motion = fma_(columns[i + n * k], d[k], motion);
      this->y[i] = motion;
    }
  }

  /// The push of a window of `count` cones of M rows, into every row outside it.
  template <int M, Team TeamT>
  STICTION_HD void push_window(TeamT& team, Index count, Index row, const Real* d) const {
    const Strided<Real, kStride> columns = A.from(Offset{n} * row);
    const Index rows = count * M;
    for_each(team, n - rows, [&](Index k) {
      const Index i = k < row ? k : k + rows;
      Real motion = this->y[i];
      if (rows == kMostBlockRows) {
        for (Index j = 0; j < kMostBlockRows; ++j) motion = fma_(columns[i + n * j], d[j], motion);
      } else {
        for (Index j = 0; j < rows; ++j) motion = fma_(columns[i + n * j], d[j], motion);
      }
      this->y[i] = motion;
    });
  }
};

}  // namespace stiction::inline STICTION_ISA
