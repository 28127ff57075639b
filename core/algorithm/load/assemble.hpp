#pragma once

#include "core/algorithm/load/inspect.hpp"
#include "core/base/transpose.hpp"

/// A of one environment from the batch's arrays, in the solver's coordinates.
namespace stiction::inline STICTION_ISA {

/// Builds the dense matrix from rows that are stored in full, in tiles. A tile is some rows of the system times as
/// many columns of the batch. Both the batch and the system are thus touched along their lines. Rows of padding are
/// scaled by zero. Meanwhile x holds the slot of each of the batch's rows. y holds where each of the system's begins
/// in the batch, and best its scale. All are numbers that a Real holds exactly.
template <Team TeamT, class Real, int kStride>
STICTION_HD void assemble_full(TeamT& team, const EnvView<Real>& env, DenseSystem<Real, kStride>& s, Real scale_a) {
  constexpr Index kEdge = kTileEdge<Real>;
  const Real* const stored = env.A + env.row_offsets[0];
  if (s.n != env.n) for_each(team, s.n * s.n, [&](Index k) { s.A[k] = 0; });
  for_each(team, s.n, [&](Index i) { s.y[i] = s.best[i] = 0; });
  for_each_slot(team, env, s, [&](Index cone, ConeSlot slot) {
    const Index first = env.cone_row(cone);
    for (Index k = 0; k < env.cone_size(cone); ++k) {
      const Index i = env.row_of(first, env.cone_size(cone), k);
      s.x[i] = static_cast<Real>(slot.row + k);
      s.y[slot.row + k] = static_cast<Real>(i * env.n);
      s.best[slot.row + k] = row_scale(env, env.kind[cone], k, i);
    }
  });
  const auto entry = [scale_a](Real a, Real of_row, Real of_column) {
    return Real(0) + (a * scale_a) * (of_row * of_column);
  };
  const auto row = [&](Index r) { return stored + static_cast<Index>(s.y[r]); };
  for_each(team, (s.n + kEdge - 1) / kEdge, [&](Index tile) {
    const Index first = tile * kEdge;
    const bool fits = first + kEdge <= s.n;
    const Real* from[kEdge];
    Real of_row[kEdge];
    for (Index r = 0; fits && r < kEdge; ++r) {
      from[r] = row(first + r);
      of_row[r] = s.best[first + r];
    }
    Index j = 0;
    for (; fits && j + kEdge <= env.n; j += kEdge) {
      Real turned[kEdge][kEdge];
      transpose_tile(from, turned);
      for (Index r = 0; r < kEdge; ++r) from[r] += kEdge;
      for (Index k = 0; k < kEdge; ++k) {
        const Index slot = static_cast<Index>(s.x[j + k]);
        const Real scale = s.best[slot];
        // No pointer leads to these numbers: a compiler sees that they may be read all at once.
        Real column[kEdge];
        for (Index r = 0; r < kEdge; ++r) column[r] = entry(turned[k][r], of_row[r], scale);
        for (Index r = 0; r < kEdge; ++r) s.A[first + r + s.n * slot] = column[r];
      }
    }
    const Index end = fits ? first + kEdge : s.n;
    for (; j < env.n; ++j) {
      const Index slot = static_cast<Index>(s.x[j]);
      const Real scale = s.best[slot];
      for (Index r = first; r < end; ++r) s.A[r + s.n * slot] = entry(row(r)[j], s.best[r], scale);
    }
  });
  for_each(team, env.n, [&](Index i) {
    const Index slot = static_cast<Index>(s.x[i]);
    const Real scale = s.best[slot];
    Real& diagonal = s.A[slot + s.n * slot];
    diagonal = diagonal + (env.R[i] * scale_a) * (scale * scale);
  });
}

/// The dense matrix. While it is built, y holds where each row's column of the matrix begins and best its scale. Both
/// are numbers a Real holds exactly (n is at most 1024 on the dense path), and neither vector is in use yet.
template <Team TeamT, class Real, int kStride>
STICTION_HD void assemble(TeamT& team, const EnvView<Real>& env, DenseSystem<Real, kStride>& s, Real scale_a) {
  if (env.is_full) {
    assemble_full(team, env, s, scale_a);
    return;
  }
  for_each(team, s.n * s.n, [&](Index k) { s.A[k] = 0; });
  for_each_slot(team, env, s, [&](Index cone, ConeSlot slot) {
    const Index first = env.cone_row(cone);
    for (Index k = 0; k < env.cone_size(cone); ++k) {
      const Index i = env.row_of(first, env.cone_size(cone), k);
      s.y[i] = static_cast<Real>((slot.row + k) * s.n);
      s.best[i] = row_scale(env, env.kind[cone], k, i);
    }
  });
  for_each_slot(team, env, s, [&](Index cone, ConeSlot slot) {
    const Index first = env.cone_row(cone);
    for (Index k = 0; k < env.cone_size(cone); ++k) {
      const Index i = env.row_of(first, env.cone_size(cone), k);
      const Strided<Real, kStride> row = s.A.from(slot.row + k);
      const Real scale = s.best[i];
      const Offset begin = env.row_offsets[i];
      const Index count = env.entries(i);
      const Index* column = env.columns(i);
      const Real* a = env.A + begin;
      if (is_run(env, i)) {
        for (Index j = 0; j < count; ++j)
          row[static_cast<Index>(s.y[j])] = Real(0) + (a[j] * scale_a) * (scale * s.best[j]);
      } else {
        for (Index t = 0; t < count; ++t) {
          const Index j = column[t];
          Real& entry = row[static_cast<Index>(s.y[j])];
          entry = entry + (a[t] * scale_a) * (scale * s.best[j]);
        }
      }
      Real& diagonal = row[static_cast<Index>(s.y[i])];
      diagonal = diagonal + (env.R[i] * scale_a) * (scale * scale);
    }
  });
}

/// The sparse values, on the batch's own pattern. best holds the row scales meanwhile.
template <Team TeamT, class Real>
STICTION_HD void assemble(TeamT& team, const EnvView<Real>& env, SparseSystem<Real>& s, Real scale_a) {
  for_each(team, env.cone_count, [&](Index cone) {
    const Index first = env.cone_row(cone);
    for (Index k = 0; k < env.cone_size(cone); ++k) s.best[first + k] = row_scale(env, env.kind[cone], k, first + k);
  });
  for_each(team, env.cone_count, [&](Index cone) {
    const Index first = env.cone_row(cone);
    const Index size = env.cone_size(cone);
    for (Index i = first; i < first + size; ++i) {
      const Real scale = s.best[i];
      s.R[i] = (env.R[i] * scale_a) * (scale * scale);
      for (Index j = 0; j < size; ++j) s.blocks[first * 6 + (i - first) * 6 + j] = 0;
      const Offset begin = env.row_offsets[i];
      const Index count = env.entries(i);
      const Index* column = env.columns(i);
      for (Index t = 0; t < count; ++t) {
        const Index j = column[t];
        const Real value = (env.A[begin + t] * scale_a) * (scale * s.best[j]);
        s.value.data[begin - env.row_offsets[0] + t] = value;
        if (j >= first && j < first + size) {
          Real& entry = s.blocks[first * 6 + (i - first) * 6 + (j - first)];
          entry = entry + value;
        }
      }
      Real& diagonal = s.blocks[first * 6 + (i - first) * 7];
      diagonal = diagonal + s.R[i];
    }
  });
}

/// The factor, each row in the solver's coordinates. The matrix scale is divided between the factors Y and Y': it is an
/// even power of two here, whose root is exact.
template <Team TeamT, class Real>
STICTION_HD void assemble(TeamT& team, const EnvView<Real>& env, FactorSystem<Real>& s, Real scale_a) {
  const Real root = sqrt_(scale_a);
  for_each(team, env.cone_count, [&](Index cone) {
    const Index first = env.cone_row(cone);
    const Index size = env.cone_size(cone);
    for (Index i = first; i < first + size; ++i) {
      const Real scale = row_scale(env, env.kind[cone], i - first, i);
      const Offset begin = static_cast<Offset>(i) * s.dofs;
      s.R[i] = (env.R[i] * scale_a) * (scale * scale);
      for (Index k = 0; k < s.dofs; ++k) s.Y.data[begin + k] = (env.factor[begin + k] * root) * scale;
    }
    for (Index i = 0; i < size; ++i)
      for (Index j = 0; j < size; ++j) {
        const Real* const left = s.row(first + i);
        const Real* const right = s.row(first + j);
        Real sum = i == j ? s.R[first + i] : Real(0);
        for (Index k = 0; k < s.dofs; ++k) sum = fma_(left[k], right[k], sum);
        s.blocks[first * 6 + i * 6 + j] = sum;
      }
  });
}

}  // namespace stiction::inline STICTION_ISA
