#pragma once

#include "core/algorithm/load/inspect.hpp"
#include "core/algorithm/residual/residual_estimate.hpp"
#include "core/base/transpose.hpp"

/// From the batch's arrays to a system in the solver's coordinates, one lane at a time.
namespace stiction::inline STICTION_ISA {

/// An upper bound on the largest eigenvalue of the symmetric part of rows and columns [kFirst, M) of a cone's block,
/// at most M^(1/16) too large: trace(B^16)^(1/16), by four squarings of B / trace(B).
template <int M, int kFirst, class System>
STICTION_HD auto largest_eigenvalue_bound(const System& s, Index row) {
  using Real = typename System::Real;
  Real trace(0);
  for (int i = kFirst; i < M; ++i) trace = trace + s.block_entry(row, i, i);
  const auto positive = trace > Real(0);
  if (!any(positive)) return Real(0);
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
  return select(positive, trace * sqrt_(sqrt_(sqrt_(sqrt_(sum)))), Real(0));
}

/// The dense matrix from rows that are stored in full, in tiles: some rows of the system times as many columns of the
/// batch at a time, so that both the batch and the system are touched along their lines. Rows of padding are
/// scaled by zero. Meanwhile x holds the place of each of the batch's rows, y where each of the system's begins in the
/// batch, best its scale: numbers that a Real holds exactly.
template <Team TeamT, class Real, int kStride>
STICTION_HD void assemble_full(TeamT& team, const EnvView<Real>& env, DenseSystem<Real, kStride>& s, Real scale_a) {
  constexpr Index kEdge = kTileEdge<Real>;
  const Real* const stored = env.A + env.row_offsets[0];
  if (s.n != env.n) for_each(team, s.n * s.n, [&](Index k) { s.A[k] = 0; });
  for_each(team, s.n, [&](Index i) { s.y[i] = s.best[i] = 0; });
  for_each_place(team, env, s, [&](Index cone, ConePlace place) {
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
  for_each(team, env.n, [&](Index i) {
    const Index place = static_cast<Index>(s.x[i]);
    const Real scale = s.best[place];
    Real& diagonal = s.A[place + s.n * place];
    diagonal = diagonal + (env.R[i] * scale_a) * (scale * scale);
  });
}

/// The dense matrix. While it is built, y holds where each row's column of the matrix begins and best its scale: both
/// are numbers a Real holds exactly (n is at most 1024 on the dense path), and neither vector is in use yet.
template <Team TeamT, class Real, int kStride>
STICTION_HD void assemble(TeamT& team, const EnvView<Real>& env, DenseSystem<Real, kStride>& s, Real scale_a) {
  if (env.is_full) {
    assemble_full(team, env, s, scale_a);
    return;
  }
  for_each(team, s.n * s.n, [&](Index k) { s.A[k] = 0; });
  for_each_place(team, env, s, [&](Index cone, ConePlace place) {
    const Index first = env.cone_row(cone);
    for (Index k = 0; k < env.cone_size(cone); ++k) {
      const Index i = env.row_of(first, env.cone_size(cone), k);
      s.y[i] = static_cast<Real>((place.row + k) * s.n);
      s.best[i] = row_scale(env, env.kind[cone], k, i);
    }
  });
  for_each_place(team, env, s, [&](Index cone, ConePlace place) {
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

/// The numbers of a cone's row k, normal first, as the batch has them, with the row's scale in best. inv_cone becomes
/// 1: there is a cone.
template <class Real, class System>
STICTION_HD void place_row(const EnvView<Real>& env, System& s, Index cone, ConePlace place, Index k, Index i) {
  const ConeKind kind = env.kind[cone];
  const Index row = place.row + k;
  s.b[row] = env.b[i];
  s.x[row] = env.warm_start != nullptr ? env.warm_start[i] : Real(0);
  s.best[row] = row_scale(env, kind, k, i);
  if (k == 0) {
    s.inv_cone[place.cone] = 1;
    s.lo[place.cone] = kind == ConeKind::box ? env.lo[i] : Real(0);
    s.hi[place.cone] = kind == ConeKind::box ? env.hi[i] : Real(0);
  }
}

/// What an environment's numbers are multiplied by.
template <class Real>
struct LoadScales {
  Real a;  ///< A, a power of two
  Real b;  ///< b, a power of two
  Real x;  ///< reactions: b / a
};
template <class Real, int kStride>
STICTION_HD LoadScales<Real> load_scales(const SystemArrays<Real, kStride>& s) {
  return {s.scalar[kScaleA], s.scalar[kScaleB], div_(s.scalar[kScaleB], s.scalar[kScaleA])};
}

/// 1 / value where that is positive, else 0.
template <class Real>
STICTION_HD Real inverse_of_positive(Real value) {
  return select(value > Real(0), div_(Real(1), value), Real(0));
}

/// Of the metric in which a convex sweep steps, diag(B_nn, tau, tau, ...) / damping, which is nowhere below the cone's
/// block B (docs/math/local_solve.md): what inv_n and inv_t do not tell.
template <class Real>
struct BlockMetric {
  Real damping;  ///< 1 / (1 + rho), where rho <= 1 is how strongly normal and tangential rows are coupled
  Real share;    ///< tau / (B_nn + tau)
};
template <int M, class System>
STICTION_HD auto block_metric(const System& s, Index row, typename System::Real inv_n, typename System::Real inv_t) {
  using Real = typename System::Real;
  Real coupling(0);
  for (int k = 1; k < M; ++k) {
    const Real entry = Real(0.5) * (s.block_entry(row, 0, k) + s.block_entry(row, k, 0));
    coupling = fma_(entry, entry, coupling);
  }
  const Real rho = sqrt_((coupling * inv_n) * inv_t);
  const Real sum = inv_n + inv_t;
  return BlockMetric<Real>{div_(Real(1), Real(1) + rho), select(sum > Real(0), div_(inv_n, sum), Real(0))};
}

/// In the lanes of `due`: what place_row() has put there in the solver's units, step lengths from the cone's rows of A,
/// which are in place and scaled, and the guess moved into the cone. trace holds the sum of the cone's diagonal.
template <class Shape, class System>
STICTION_HD void finish_cone(Shape shape, System& s, Index cone, Index row,
                             const LoadScales<typename System::Real>& scales, Mask<typename System::Real> due) {
  using Real = typename System::Real;
  constexpr int kRows = Shape::kRows;
  const auto put = [due](Real& to, Real value) { to = select(due, value, to); };
  // A slot without a cone weighs nothing, as all of it is zero.
  const Real mean = kRows == 1 ? s.trace[cone] : div_(s.trace[cone], Real(kRows));
  put(s.trace[cone], select(s.inv_cone[cone] > Real(0), residual_weight(mean * scales.a), Real(0)));
  const Real inv_n = inverse_of_positive(s.block_entry(row, 0, 0));
  put(s.inv_n[cone], inv_n);
  if constexpr (kRows == 1) {
    put(s.inv_t[cone], Real(0));
    put(s.inv_cone[cone], inv_n);
    put(s.damping[cone], Real(1));
    put(s.share[cone], Real(0));
  } else {
    // A tangential block that couples to nothing still needs a finite step: its rows slide to the disk's edge.
    const Real whole = largest_eigenvalue_bound<kRows, 0>(s, row);
    const Real tangential = largest_eigenvalue_bound<kRows, 1>(s, row);
    const Real inv_t = inverse_of_positive(max_(tangential, whole * Real(kSmallestTangential)));
    const BlockMetric<Real> metric = block_metric<kRows>(s, row, inv_n, inv_t);
    put(s.inv_t[cone], inv_t);
    put(s.inv_cone[cone], inverse_of_positive(whole));
    put(s.damping[cone], metric.damping);
    put(s.share[cone], metric.share);
  }
  if constexpr (Shape::kKind == ConeKind::box) {
    put(s.lo[cone], s.lo[cone] * scales.x);
    put(s.hi[cone], s.hi[cone] * scales.x);
  }
  Real z[kRows];
  Real still[kRows];
  for (int k = 0; k < kRows; ++k) {
    const Real scale = s.best[row + k];
    put(s.b[row + k], (s.b[row + k] * scales.b) * scale);
    z[k] = select(scale > Real(0), div_(s.x[row + k] * scales.x, scale), Real(0));
    still[k] = Real(0);
  }
  proximal_point<Law::convex>(shape, z, still, Real(0), s.lo[cone], s.hi[cone]);
  for (int k = 0; k < kRows; ++k) put(s.x[row + k], canonical_zero(z[k]));
}

/// max|A - A'| / max|A| of n rows or columns that lie one behind the other.
template <Team TeamT, class Real, int kStride>
STICTION_HD Real asymmetry(TeamT& team, Strided<Real, kStride> A, Index n) {
  Real largest(0);
  Real difference(0);
  for (Index j = team.rank(); j < n; j += team.size()) {
    const Strided<Real, kStride> column = A.from(Offset{n} * j);
    for (Index i = 0; i < n; ++i) {
      largest = max_(abs_(column[i]), largest);
      difference = max_(abs_(column[i] - A[j + n * i]), difference);
    }
  }
  largest = team.max(largest);
  difference = team.max(difference);
  return largest > Real(0) ? div_(difference, largest) : Real(0);
}

/// The same of a dense system.
template <Team TeamT, class Real, int kStride>
STICTION_HD Real asymmetry(TeamT& team, const DenseSystem<Real, kStride>& s) {
  return asymmetry(team, s.A, s.n);
}

/// The same on a sparse pattern; an entry whose transpose is not stored counts in full. Duplicates are compared one by
/// one and may overstate the difference.
template <Team TeamT, class Real>
STICTION_HD Real asymmetry(TeamT& team, const SparseSystem<Real>& s) {
  const EnvView<Real>& env = *s.env;
  const Offset base = env.row_offsets[0];
  Real largest(0);
  Real difference(0);
  const auto value = [&](Index row, Index k) { return s.value.data[env.row_offsets[row] - base + k]; };
  for (Index i = team.rank(); i < s.n; i += team.size())
    for (Index k = 0; k < env.entries(i); ++k) {
      const Index j = env.columns(i)[k];
      Real mirrored(0);
      for (Index t = 0; t < env.entries(j); ++t)
        if (env.columns(j)[t] == i) mirrored = value(j, t);
      largest = max_(abs_(value(i, k)), largest);
      difference = max_(abs_(value(i, k) - mirrored), difference);
    }
  largest = team.max(largest);
  difference = team.max(difference);
  return largest > Real(0) ? div_(difference, largest) : Real(0);
}

/// Y Y' is symmetric.
template <Team TeamT, class Real>
STICTION_HD Real asymmetry(TeamT&, const FactorSystem<Real>&) {
  return Real(0);
}

/// How far A may be from symmetric for a method that minimises.
inline constexpr float kLargestAsymmetry = 1e-2F;

/// What a method asks of the numbers it is given.
struct LoadRules {
  bool needs_symmetry;      ///< an asymmetric A is refused
  bool takes_any_diagonal;  ///< rows whose diagonal is not positive are not
};
/// A method that goes without the matrices it has for smaller environments takes conjugate gradients, for which A has
/// to be symmetric under any law.
template <class Method, class System>
STICTION_HD LoadRules load_rules(Law law, const System& s) {
  constexpr Workspace kWorkspace = Method::workspace();
  const bool takes_gradients = kWorkspace.matrix_free_vectors > 0 && !s.has_matrices;
  return {Method::needs_symmetry(law) || takes_gradients, requires {Method::kTakesAnyDiagonal;
}
};
}

/// Whether an environment that was found to be sound starts from its guess.
template <class Real>
STICTION_HD bool takes_warm_start(const EnvView<Real>& env, const Inspection<Real>& seen) {
  // With b = 0 the answer is zero, and no warm start is better.
  return env.warm_start != nullptr && (seen.flags & kFlagWarmStartRejected) == 0 && seen.largest_b > Real(0);
}

/// The scalars of an environment that has not begun.
template <class Real, class System>
STICTION_HD void start_scalars(System& s, const Inspection<Real>& seen) {
  const Real scale_b = unit_scale(seen.largest_b);
  s.scalar[kBestResidual] = s.scalar[kLastResidual] = static_cast<Real>(__builtin_huge_valf());
  s.scalar[kNormB] = seen.largest_b > Real(0) ? seen.largest_b * scale_b : Real(1);
  s.scalar[kScaleA] = matrix_scale(s, seen.largest_diagonal);
  s.scalar[kScaleB] = scale_b;
  s.scalar[kOutcome] = Real(kRunning);
}

/// Brings one environment into the solver's coordinates: all that depends neither on the method nor on its law. Returns
/// the flags; with any but kHarmlessFlags set the system is not to be used.
template <Team TeamT, class Real, class System>
STICTION_HD_SHARED std::uint32_t load_system(TeamT& team, const EnvView<Real>& env, System& s, LoadRules rules) {
  for_each(team, s.cones, [&](Index c) {
    s.trace[c] = s.inv_n[c] = s.inv_t[c] = s.inv_cone[c] = s.damping[c] = s.share[c] = s.lo[c] = s.hi[c] = 0;
  });
  const Inspection<Real> seen = inspect(team, env, s);
  std::uint32_t flags = rules.takes_any_diagonal ? seen.flags & ~kFlagBadDiagonal : seen.flags;
  if ((flags & ~kHarmlessFlags) != 0) return flags;
  single(team, [&] { start_scalars(s, seen); });
  const LoadScales<Real> scales = load_scales(s);
  assemble(team, env, s, scales.a);
  for_each(team, s.n, [&](Index i) { s.b[i] = s.x[i] = s.best[i] = 0; });
  const bool warm = takes_warm_start(env, seen);
  for_each_place(team, env, s, [&](Index cone, ConePlace place) {
    const Index first = env.cone_row(cone);
    const Index size = env.cone_size(cone);
    for (Index k = 0; k < size; ++k) {
      place_row(env, s, cone, place, k, env.row_of(first, size, k));
      if (!warm) s.x[place.row + k] = 0;
    }
    with_shape(env.kind[cone], size, [&](auto shape) { finish_cone(shape, s, place.cone, place.row, scales, true); });
  });
  if (rules.needs_symmetry && asymmetry(team, s) > Real(kLargestAsymmetry)) return flags | kFlagAsymmetric;
  return flags;
}

/// Flags of an environment that a method cannot treat: one it has no matrix for, or whatever else it says itself.
template <class Method, class System>
STICTION_HD std::uint32_t unsupported_flags(const System& s) {
  constexpr Workspace kWorkspace = Method::workspace();
  std::uint32_t flags =
      kWorkspace.dense_matrices > 0 && kWorkspace.matrix_free_vectors == 0 && !s.has_matrices ? kFlagNoRoom : 0U;
  if constexpr (requires { Method::unsupported(s); }) flags |= Method::unsupported(s);
  return flags;
}

/// Starts the method on a system whose first iterate is recorded; it may first take from the environment what the
/// system does not keep.
template <class Method, Law kLaw, Team TeamT, class Real, class System>
STICTION_HD void start_method(TeamT& team, const EnvView<Real>& env, System& s) {
  if constexpr (requires { Method::load(team, env, s); }) Method::load(team, env, s);
  Method::template start<kLaw>(team, s);
}

/// Records the first iterate of a loaded system and starts the method.
template <class Method, Law kLaw, Team TeamT, class Real, class System>
STICTION_HD void begin_method(TeamT& team, const EnvView<Real>& env, System& s) {
  refresh_motion(team, s);
  for_each(team, s.n, [&](Index i) { s.best[i] = s.x[i]; });
  record<Method, kLaw>(team, s, true);
  start_method<Method, kLaw>(team, env, s);
}

/// Whether an environment with those flags can be solved.
STICTION_HD bool is_solvable(std::uint32_t flags) {
  return (flags & ~kHarmlessFlags) == 0;
}

/// Both, for machines that do all in one go. Returns the flags.
template <class Method, Law kLaw, Team TeamT, class Real, class System>
STICTION_HD std::uint32_t prepare(TeamT& team, const EnvView<Real>& env, System& s) {
  const std::uint32_t flags = load_system(team, env, s, load_rules<Method>(kLaw, s)) | unsupported_flags<Method>(s);
  if (is_solvable(flags)) begin_method<Method, kLaw>(team, env, s);
  return flags;
}

}  // namespace stiction::inline STICTION_ISA
