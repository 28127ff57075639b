#pragma once

#include <type_traits>

#include "core/algorithm/derivative/find_modes.hpp"
#include "core/algorithm/linear/dense/dense_lu.hpp"

/// The linear system of the modes, G = F'(A + diag R) E + D, or its transpose (docs/math/derivative.md). In double
/// whatever the batch's precision: numbers are few, and a system in single would need one of double to be refined by.
namespace stiction::inline STICTION_ISA {

/// Entry (f, c) of G where G, or its transpose, is stored.
template <bool kTransposed, class Matrix>
STICTION_HD auto& system_entry(const Matrix& K, Index f, Index c) {
  return kTransposed ? K(c, f) : K(f, c);
}

/// Adds entry (i, j) of A + diag R to column c of a cone's rows of G. sum(f) gets F(i, f) * moved, f in [begin, end).
/// `F`: row i of it. `moved`: the entry times E(j, c).
template <class Wide, class Sum>
STICTION_HD void add_moved(const Wide* F, Wide moved, Index begin, Index end, const Sum& sum) {
  for (Index f = begin; f < end; ++f) {
    Wide& entry = sum(f);
    entry = fma_(F[f], moved, entry);
  }
}

/// Returns true if a contact slides that more pressure would press on less. `normal_gain`: its diagonal entry of G.
STICTION_HD bool is_unstable(Index mode, double normal_gain) {
  return mode == static_cast<Index>(ConeMode::sliding) && !(normal_gain > 0.0);
}

/// G of rows F and columns E. A lane takes the rows of a cone; stored entries of A add up in stored order.
template <bool kTransposed, Team TeamT, class Real>
STICTION_HD void fill_system(TeamT& team, const EnvView<Real>& env, const DerivativeScratch& s, const DenseMatrix& K) {
  for_each(team, env.cone_count, [&](Index cone) {
    const Index first = s.first[cone], count = s.first[cone + 1] - first;
    if (count == 0) return;
    for (Index f = 0; f < count; ++f)
      for (Index c = 0; c < K.n; ++c) system_entry<kTransposed>(K, first + f, c) = 0.0;
    const Index row = env.cone_row(cone), size = env.cone_size(cone);
    const auto add = [&](Index i, Index j, double value) {
      const Index other = s.cone_of_row[j], begin = s.first[other], others = s.first[other + 1] - begin;
      for (Index c = 0; c < others; ++c) {
        const double moved = value * s.E[static_cast<Offset>(j) * kMaxConeRows + c];
        if (moved == 0.0) continue;
        add_moved(s.F + static_cast<Offset>(i) * kMaxConeRows, moved, 0, count,
                  [&](Index f) -> double& { return system_entry<kTransposed>(K, first + f, begin + c); });
      }
    };
    for (Index i = row; i < row + size; ++i) {
      const Real* const a = env.factor == nullptr ? env.A + env.row_offsets[i] : nullptr;
      if (a != nullptr && env.entries(i) == env.n && is_run(env.columns(i), env.n)) {
        for (Index m = 0; m < s.moving[env.n]; ++m) add(i, s.moving[m], static_cast<double>(a[s.moving[m]]));
      } else if (a != nullptr) {
        const Index* const column = env.columns(i);
        for (Index k = 0; k < env.entries(i); ++k) add(i, column[k], static_cast<double>(a[k]));
      }
      add(i, i, static_cast<double>(env.R[i]));
    }
    for (Index f = 0; f < count; ++f) {
      double& entry = system_entry<kTransposed>(K, first + f, first + f);
      entry = entry + s.D[row + f];
    }
  });
}

/// Y' E and Y' F, and their product added to G, where A = Y Y' is not stored.
template <bool kTransposed, Team TeamT, class Real>
STICTION_HD void add_factor(TeamT& team, const EnvView<Real>& env, const DerivativeScratch& s, const DenseMatrix& K) {
  const auto project = [&](const double* basis, double* out) {
    for_each(team, env.cone_count, [&](Index cone) {
      const Index row = env.cone_row(cone), size = env.cone_size(cone), first = s.first[cone];
      for (Index c = first; c < s.first[cone + 1]; ++c)
        for (Index k = 0; k < env.dofs; ++k) {
          double sum = 0.0;
          for (Index i = row; i < row + size; ++i)
            sum = fma_(static_cast<double>(env.factor[static_cast<Offset>(i) * env.dofs + k]),
                       basis[static_cast<Offset>(i) * kMaxConeRows + c - first], sum);
          out[static_cast<Offset>(c) * env.dofs + k] = sum;
        }
    });
  };
  project(s.F, s.left);
  project(s.E, s.right);
  for_each(team, K.n, [&](Index f) {
    for (Index c = 0; c < K.n; ++c) {
      double& entry = system_entry<kTransposed>(K, f, c);
      const double* const left = s.left + static_cast<Offset>(f) * env.dofs;
      const double* const right = s.right + static_cast<Offset>(c) * env.dofs;
      for (Index k = 0; k < env.dofs; ++k) entry = fma_(left[k], right[k], entry);
    }
  });
}

/// Divides rows, then columns, by powers of two near their largest entries, which rounds nothing. The scale that a
/// pivot is small against then does not depend on the units of rows.
template <Team TeamT, class Matrix, class Wide>
STICTION_HD void equilibrate(TeamT& team, const Matrix& K, Wide* row_scale, Wide* column_scale) {
  for_each(team, K.n, [&](Index i) {
    Wide largest(0);
    for (Index j = 0; j < K.n; ++j) largest = max_(abs_(K(i, j)), largest);
    row_scale[i] = unit_scale(largest);
  });
  for_each(team, K.n, [&](Index j) {
    Wide largest(0);
    for (Index i = 0; i < K.n; ++i) {
      K(i, j) = K(i, j) * row_scale[i];
      largest = max_(abs_(K(i, j)), largest);
    }
    column_scale[j] = unit_scale(largest);
    for (Index i = 0; i < K.n; ++i) K(i, j) = K(i, j) * column_scale[j];
  });
}

/// A pivot that is not above this is one of rounding, of the batch's numbers or of the elimination's.
template <class Real>
STICTION_HD double pivot_floor(Index n) {
  constexpr double kUnit = sizeof(Real) == sizeof(float) ? 0x1p-23 : 0x1p-52;
  return 16.0 * kUnit + static_cast<double>(n) * 0x1p-52;
}

/// Builds and factors G, or its transpose. Returns flags, on every lane: singular, an unstable branch.
template <bool kTransposed, Team TeamT, class Real>
STICTION_HD_OUTLINE std::uint32_t factor_system(TeamT& team, const EnvView<Real>& env, const DerivativeScratch& s,
                                                Index unknowns) {
  const DenseMatrix K{s.K, unknowns};
  fill_system<kTransposed>(team, env, s, K);
  if (env.factor != nullptr) add_factor<kTransposed>(team, env, s, K);
  std::uint32_t flags = 0;
  for_each(team, env.cone_count, [&](Index cone) {
    const Index first = s.first[cone];
    if (s.first[cone + 1] > first && is_unstable(s.mode[cone], K(first, first))) flags |= kGradientUnstableBranch;
  });
  equilibrate(team, K, s.row_scale, s.column_scale);
  if (factor_lu(team, K, s.pivots, pivot_floor<Real>(unknowns)) > 0) flags |= kGradientSingular;
  return team.combine(flags);
}

/// unknown = K^-1 unknown, K being the factor of G or of its transpose.
template <Team TeamT, class Matrix, class Scratch>
STICTION_HD void solve_system(TeamT& team, const Matrix& K, const Scratch& s) {
  for_each(team, K.n, [&](Index k) { s.unknown[k] = s.unknown[k] * s.row_scale[k]; });
  solve_lu(team, K, s.pivots, s.unknown);
  for_each(team, K.n, [&](Index k) { s.unknown[k] = s.unknown[k] * s.column_scale[k]; });
}

/// Returns true if `mine` is on all lanes of a team; in lanes of a pack, which one thread has, `mine` of each lane.
template <Team TeamT, class Truth>
STICTION_HD Truth true_on_all(TeamT& team, Truth mine) {
  if constexpr (std::is_same_v<Truth, bool>) {
    return team.combine(mine ? 0U : 1U) == 0;
  } else {
    return mine;
  }
}

/// Quality of the solution of a set, by the returned numbers.
template <class Wide>
struct SolutionCheck {
  Wide residual;  ///< of the system relative to its right-hand side
  Mask<Wide> is_finite;
};
/// Largest residual and right-hand side of an unknown, over each lane of a team.
template <Team TeamT, class Wide>
STICTION_HD SolutionCheck<Wide> check_solution(TeamT& team, Wide left, Wide right, Mask<Wide> is_finite) {
  const Wide residual = team.max(left), largest = team.max(right);
  const auto is_seeded = largest > Wide(0);
  return {select(is_seeded, div_(residual, select(is_seeded, largest, Wide(1))), Wide(0)),
          true_on_all(team, is_finite)};
}

}  // namespace stiction::inline STICTION_ISA
