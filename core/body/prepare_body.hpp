#pragma once

#include "core/base/transpose.hpp"
#include "core/body/inspect_body.hpp"
#include "core/body/record_body.hpp"

/// From the batch's arrays to a system in the solver's coordinates, one lane at a time.
namespace stiction::inline STICTION_ISA {

/// An upper bound on the largest eigenvalue of the symmetric part of rows and columns [kFirst, M) of a cone's block,
/// at most M^(1/16) too large: trace(B^16)^(1/16), by four squarings of B / trace(B).
template <int M, int kFirst, class System>
STICTION_HD auto largest_eigenvalue_bound(const System& s, Index row) {
  using Real = typename System::Real;
  Real trace(0);
  for (int i = kFirst; i < M; ++i) trace = trace + s.block_entry(row, i, i);
  if (!(trace > Real(0))) return Real(0);
  // The powers of a symmetric matrix are symmetric: the upper triangle is enough.
  const Real inverse = div_(Real(0.5), trace);
  Real power[M][M];
  for (int i = kFirst; i < M; ++i)
    for (int j = i; j < M; ++j)
      power[i][j] = power[j][i] = (s.block_entry(row, i, j) + s.block_entry(row, j, i)) * inverse;
  for (int squaring = 0; squaring < 4; ++squaring) {
    Real square[M][M];
    for (int i = kFirst; i < M; ++i)
      for (int j = i; j < M; ++j) {
        Real sum = power[i][kFirst] * power[kFirst][j];
        for (int k = kFirst + 1; k < M; ++k) sum = fma_(power[i][k], power[k][j], sum);
        square[i][j] = square[j][i] = sum;
      }
    for (int i = kFirst; i < M; ++i)
      for (int j = kFirst; j < M; ++j) power[i][j] = square[i][j];
  }
  Real sum(0);
  for (int i = kFirst; i < M; ++i) sum = sum + power[i][i];
  return trace * sqrt_(sqrt_(sqrt_(sqrt_(sum))));
}

/// The dense matrix from rows that are stored in full, in tiles: some rows of the system times as many columns of the
/// batch at a time, so that both the batch and the system are touched along their lines. Rows of padding are
/// scaled by zero. Meanwhile x holds the place of each of the batch's rows, y where each of the system's begins in the
/// batch, best its scale: numbers that a Real holds exactly.
template <Block B, class Real, int kStride>
STICTION_HD void assemble_full(B& block, const EnvView<Real>& env, DenseSystem<Real, kStride>& s, Real scale_a) {
  constexpr Index kEdge = kTileEdge<Real>;
  const Real* const stored = env.A + env.row_offsets[0];
  if (s.n != env.n) for_each(block, s.n * s.n, [&](Index k) { s.A[k] = 0; });
  for_each(block, s.n, [&](Index i) { s.y[i] = s.best[i] = 0; });
  for_each_place(block, env, s, [&](Index cone, ConePlace place) {
    const Index first = env.cone_row(cone);
    for (Index k = 0; k < env.cone_size(cone); ++k) {
      const Index i = env.row_of(first, env.cone_size(cone), k);
      s.x[i] = static_cast<Real>(place.row + k);
      s.y[place.row + k] = static_cast<Real>(i * env.n);
      s.best[place.row + k] = row_scale(env, env.kind[cone], k, i);
    }
  });
  const auto entry = [scale_a](Real a, Real of_row, Real of_column) {
    return Real(0) + (a * scale_a) * (of_row * of_column);
  };
  const auto row = [&](Index r) { return stored + static_cast<Index>(s.y[r]); };
  for_each(block, (s.n + kEdge - 1) / kEdge, [&](Index tile) {
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
        const Index place = static_cast<Index>(s.x[j + k]);
        const Real scale = s.best[place];
        // No pointer leads to what these read: a compiler sees that they may be read all at once.
        Real column[kEdge];
        for (Index r = 0; r < kEdge; ++r) column[r] = entry(turned[k][r], of_row[r], scale);
        for (Index r = 0; r < kEdge; ++r) s.A[first + r + s.n * place] = column[r];
      }
    }
    const Index end = fits ? first + kEdge : s.n;
    for (; j < env.n; ++j) {
      const Index place = static_cast<Index>(s.x[j]);
      const Real scale = s.best[place];
      for (Index r = first; r < end; ++r) s.A[r + s.n * place] = entry(row(r)[j], s.best[r], scale);
    }
  });
  for_each(block, env.n, [&](Index i) {
    const Index place = static_cast<Index>(s.x[i]);
    const Real scale = s.best[place];
    Real& diagonal = s.A[place + s.n * place];
    diagonal = diagonal + (env.R[i] * scale_a) * (scale * scale);
  });
}

/// The dense matrix. While it is built, y holds where each row's column of the matrix begins and best its scale: both
/// are numbers a Real holds exactly (n is at most 1024 on the dense path), and neither vector is in use yet.
template <Block B, class Real, int kStride>
STICTION_HD void assemble(B& block, const EnvView<Real>& env, DenseSystem<Real, kStride>& s, Real scale_a) {
  if (env.is_full) {
    assemble_full(block, env, s, scale_a);
    return;
  }
  for_each(block, s.n * s.n, [&](Index k) { s.A[k] = 0; });
  for_each_place(block, env, s, [&](Index cone, ConePlace place) {
    const Index first = env.cone_row(cone);
    for (Index k = 0; k < env.cone_size(cone); ++k) {
      const Index i = env.row_of(first, env.cone_size(cone), k);
      s.y[i] = static_cast<Real>((place.row + k) * s.n);
      s.best[i] = row_scale(env, env.kind[cone], k, i);
    }
  });
  for_each_place(block, env, s, [&](Index cone, ConePlace place) {
    const Index first = env.cone_row(cone);
    for (Index k = 0; k < env.cone_size(cone); ++k) {
      const Index i = env.row_of(first, env.cone_size(cone), k);
      const Strided<Real, kStride> row = s.A.from(place.row + k);
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
template <Block B, class Real>
STICTION_HD void assemble(B& block, const EnvView<Real>& env, SparseSystem<Real>& s, Real scale_a) {
  for_each(block, env.cone_count, [&](Index cone) {
    const Index first = env.cone_row(cone);
    for (Index k = 0; k < env.cone_size(cone); ++k) s.best[first + k] = row_scale(env, env.kind[cone], k, first + k);
  });
  for_each(block, env.cone_count, [&](Index cone) {
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
template <Block B, class Real>
STICTION_HD void assemble(B& block, const EnvView<Real>& env, FactorSystem<Real>& s, Real scale_a) {
  const Real root = sqrt_(scale_a);
  for_each(block, env.cone_count, [&](Index cone) {
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

/// The power of two that A is multiplied by.
template <class Real, class System>
STICTION_HD Real matrix_scale(const System&, Real largest_diagonal) {
  return unit_scale(largest_diagonal);
}
template <class Real>
STICTION_HD Real matrix_scale(const FactorSystem<Real>&, Real largest_diagonal) {
  const Real root = unit_scale(sqrt_(largest_diagonal));
  return root * root;
}

/// Smallest tangential step bound relative to the whole block's.
inline constexpr float kSmallestTangential = 1.0F / (1 << 30);

/// b, bounds, step lengths and the first iterate of the cone at `place`, whose trace holds the sum of its diagonal.
template <class Real, class System>
STICTION_HD void prepare_cone(const EnvView<Real>& env, System& s, Index cone, ConePlace place, Real scale_a,
                              Real scale_b, bool warm) {
  const ConeKind kind = env.kind[cone];
  const Index first = env.cone_row(cone);
  const Index size = env.cone_size(cone);
  const Real scale_x = div_(scale_b, scale_a);
  s.trace[place.cone] = residual_weight(div_(s.trace[place.cone], static_cast<Real>(size)) * scale_a);
  s.lo[place.cone] = kind == ConeKind::box ? env.lo[first] * scale_x : Real(0);
  s.hi[place.cone] = kind == ConeKind::box ? env.hi[first] * scale_x : Real(0);
  with_shape(kind, size, [&](auto shape) {
    constexpr int kRows = decltype(shape)::kRows;
    const Real normal = s.block_entry(place.row, 0, 0);
    s.inv_n[place.cone] = normal > Real(0) ? div_(Real(1), normal) : Real(0);
    if constexpr (kRows == 1) {
      s.inv_t[place.cone] = 0;
      s.inv_cone[place.cone] = s.inv_n[place.cone];
    } else {
      // A tangential block that couples to nothing still needs a finite step: its rows slide to the disk's edge.
      const Real whole = largest_eigenvalue_bound<kRows, 0>(s, place.row);
      const Real tangential = largest_eigenvalue_bound<kRows, 1>(s, place.row);
      const Real floored = max_(tangential, whole * Real(kSmallestTangential));
      s.inv_t[place.cone] = floored > Real(0) ? div_(Real(1), floored) : Real(0);
      s.inv_cone[place.cone] = whole > Real(0) ? div_(Real(1), whole) : Real(0);
    }
    Real z[kRows];
    Real still[kRows];
    for (int k = 0; k < kRows; ++k) {
      const Index i = env.row_of(first, size, k);
      const Real scale = row_scale(env, kind, k, i);
      s.b[place.row + k] = (env.b[i] * scale_b) * scale;
      z[k] = warm && scale > Real(0) ? div_(env.warm_start[i] * scale_x, scale) : Real(0);
      still[k] = 0;
    }
    proximal_point<Law::convex>(shape, z, still, Real(0), s.lo[place.cone], s.hi[place.cone]);
    for (int k = 0; k < kRows; ++k) s.x[place.row + k] = canonical_zero(z[k]);
  });
}

/// max|A - A'| / max|A| of the dense system.
template <Block B, class Real, int kStride>
STICTION_HD Real asymmetry(B& block, const DenseSystem<Real, kStride>& s) {
  Real largest(0);
  Real difference(0);
  for (Index j = block.rank(); j < s.n; j += block.size()) {
    const Strided<Real, kStride> column = s.A.from(Offset{s.n} * j);
    for (Index i = 0; i < s.n; ++i) {
      largest = max_(abs_(column[i]), largest);
      difference = max_(abs_(column[i] - s.A[j + s.n * i]), difference);
    }
  }
  largest = block.max(largest);
  difference = block.max(difference);
  return largest > Real(0) ? div_(difference, largest) : Real(0);
}

/// The same on a sparse pattern; an entry whose transpose is not stored counts in full. Duplicates are compared one by
/// one and may overstate the difference.
template <Block B, class Real>
STICTION_HD Real asymmetry(B& block, const SparseSystem<Real>& s) {
  const EnvView<Real>& env = *s.env;
  const Offset base = env.row_offsets[0];
  Real largest(0);
  Real difference(0);
  const auto value = [&](Index row, Index k) { return s.value.data[env.row_offsets[row] - base + k]; };
  for (Index i = block.rank(); i < s.n; i += block.size())
    for (Index k = 0; k < env.entries(i); ++k) {
      const Index j = env.columns(i)[k];
      Real mirrored(0);
      for (Index t = 0; t < env.entries(j); ++t)
        if (env.columns(j)[t] == i) mirrored = value(j, t);
      largest = max_(abs_(value(i, k)), largest);
      difference = max_(abs_(value(i, k) - mirrored), difference);
    }
  largest = block.max(largest);
  difference = block.max(difference);
  return largest > Real(0) ? div_(difference, largest) : Real(0);
}

/// Y Y' is symmetric.
template <Block B, class Real>
STICTION_HD Real asymmetry(B&, const FactorSystem<Real>&) {
  return Real(0);
}

/// How far A may be from symmetric for a method that minimises.
inline constexpr float kLargestAsymmetry = 1e-2F;

/// What a method asks of the numbers it is given.
struct LoadRules {
  bool needs_symmetry;      ///< an asymmetric A is refused
  bool takes_any_diagonal;  ///< rows whose diagonal is not positive are not
};
/// Whoever goes without the matrices it has for smaller environments takes conjugate gradients, for which A has to be
/// symmetric under any law.
template <class Method, class System>
STICTION_HD LoadRules load_rules(Law law, const System& s) {
  constexpr MethodRoom kRoom = Method::room();
  const bool takes_gradients = kRoom.instead > 0 && !s.has_matrices;
  return {Method::needs_symmetry(law) || takes_gradients, requires {Method::kTakesAnyDiagonal;
}
};
}

/// Brings one environment into the solver's coordinates: all that depends neither on the method nor on its law. Returns
/// the flags; with any but kHarmlessFlags set the system is not to be used.
template <Block B, class Real, class System>
STICTION_HD_SHARED std::uint32_t load_system(B& block, const EnvView<Real>& env, System& s, LoadRules rules) {
  for_each(block, s.cones,
           [&](Index c) { s.trace[c] = s.inv_n[c] = s.inv_t[c] = s.inv_cone[c] = s.lo[c] = s.hi[c] = 0; });
  const Inspection<Real> seen = inspect(block, env, s);
  std::uint32_t flags = rules.takes_any_diagonal ? seen.flags & ~kFlagBadDiagonal : seen.flags;
  if ((flags & ~kHarmlessFlags) != 0) return flags;
  const Real scale_a = matrix_scale(s, seen.largest_diagonal);
  const Real scale_b = unit_scale(seen.largest_b);
  // With b = 0 the answer is zero, and no warm start is better.
  const bool warm = env.warm_start != nullptr && (flags & kFlagWarmStartRejected) == 0 && seen.largest_b > Real(0);
  assemble(block, env, s, scale_a);
  for_each(block, s.n, [&](Index i) { s.b[i] = s.x[i] = 0; });
  for_each_place(block, env, s,
                 [&](Index cone, ConePlace place) { prepare_cone(env, s, cone, place, scale_a, scale_b, warm); });
  if (rules.needs_symmetry && asymmetry(block, s) > Real(kLargestAsymmetry)) return flags | kFlagAsymmetric;
  single(block, [&] {
    s.scalar[kBestResidual] = s.scalar[kLastResidual] = static_cast<Real>(__builtin_huge_valf());
    s.scalar[kNormB] = seen.largest_b > Real(0) ? seen.largest_b * scale_b : Real(1);
    s.scalar[kScaleA] = scale_a;
    s.scalar[kScaleB] = scale_b;
    s.scalar[kOutcome] = Real(kRunning);
  });
  return flags;
}

/// Flags of an environment that a method cannot treat: one it has no matrix for, or whatever else it says itself.
template <class Method, class System>
STICTION_HD std::uint32_t unsupported_flags(const System& s) {
  constexpr MethodRoom kRoom = Method::room();
  std::uint32_t flags = kRoom.matrices > 0 && kRoom.instead == 0 && !s.has_matrices ? kFlagNoRoom : 0U;
  if constexpr (requires { Method::unsupported(s); }) flags |= Method::unsupported(s);
  return flags;
}

/// Records the first iterate of a loaded system and starts the method, which may first take from the environment what
/// the system does not keep.
template <class Method, Law kLaw, Block B, class Real, class System>
STICTION_HD void begin_method(B& block, const EnvView<Real>& env, System& s) {
  refresh_motion(block, s);
  for_each(block, s.n, [&](Index i) { s.best[i] = s.x[i]; });
  record<Method, kLaw>(block, s, true);
  if constexpr (requires { Method::load(block, env, s); }) Method::load(block, env, s);
  Method::template start<kLaw>(block, s);
}

/// Whether an environment with those flags can be solved.
STICTION_HD bool is_solvable(std::uint32_t flags) {
  return (flags & ~kHarmlessFlags) == 0;
}

/// Both, for machines that do all in one go. Returns the flags.
template <class Method, Law kLaw, Block B, class Real, class System>
STICTION_HD std::uint32_t prepare(B& block, const EnvView<Real>& env, System& s) {
  const std::uint32_t flags = load_system(block, env, s, load_rules<Method>(kLaw, s)) | unsupported_flags<Method>(s);
  if (is_solvable(flags)) begin_method<Method, kLaw>(block, env, s);
  return flags;
}

}  // namespace stiction::inline STICTION_ISA
