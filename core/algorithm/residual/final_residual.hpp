#pragma once

#include "core/algorithm/residual/residual_estimate.hpp"
#include "core/base/dot4.hpp"

namespace stiction::inline STICTION_ISA {

/// What the motion of row i begins with: b + R lambda, in double.
template <class Real>
STICTION_HD double row_start(const EnvView<Real>& env, Index row) {
  return fma_(static_cast<double>(env.R[row]), static_cast<double>(env.lambda[row]), static_cast<double>(env.b[row]));
}

/// start + row i of A times lambda, in double, over four interleaved partial sums in stored order, as in the sparse
/// sweep.
template <class Real>
STICTION_HD_OUTLINE double row_motion(const EnvView<Real>& env, Index row, double start) {
  const Offset begin = env.row_offsets[row];
  const Index count = env.entries(row);
  const Real* a = env.A + begin;
  const Index* column = env.columns(row);
  if (is_run(env, row)) return four_sums(start, a, env.lambda, count);
  double sum[4] = {start, 0.0, 0.0, 0.0};
  add_to_four_sums(sum, 0, count, [&](Index k) { return a[k]; }, [&](Index k) { return env.lambda[column[k]]; });
  return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

/// start + the diagonal entry of row i; duplicates add up.
template <class Real>
STICTION_HD_OUTLINE double row_diagonal(const EnvView<Real>& env, Index row, double start) {
  const Offset begin = env.row_offsets[row];
  const Index count = env.entries(row);
  const Index* column = env.columns(row);
  if (row < count && is_run(env, row)) return start + static_cast<double>(env.A[begin + row]);
  for (Index k = 0; k < count; ++k)
    if (column[k] == row) start = start + static_cast<double>(env.A[begin + k]);
  return start;
}

/// Rows of A where they are stored, as the final residual reads them.
template <class Real>
struct StoredRows {
  const EnvView<Real>* env;
  [[nodiscard]] STICTION_HD double motion(Index row, double start) const { return row_motion(*env, row, start); }
  [[nodiscard]] STICTION_HD double diagonal(Index row, double start) const { return row_diagonal(*env, row, start); }
};

/// Rows of A = Y Y', as the final residual reads them; `velocity` is Y' lambda.
template <class Real>
struct FactorRows {
  const EnvView<Real>* env;
  const double* velocity;
  [[nodiscard]] STICTION_HD_OUTLINE double motion(Index row, double start) const {
    const Real* y = env->factor + static_cast<Offset>(row) * env->dofs;
    double sum = start;
    for (Index k = 0; k < env->dofs; ++k) sum = fma_(static_cast<double>(y[k]), velocity[k], sum);
    return sum;
  }
  [[nodiscard]] STICTION_HD_OUTLINE double diagonal(Index row, double start) const {
    const Real* y = env->factor + static_cast<Offset>(row) * env->dofs;
    double sum = start;
    for (Index k = 0; k < env->dofs; ++k) sum = fma_(static_cast<double>(y[k]), static_cast<double>(y[k]), sum);
    return sum;
  }
};

template <Team TeamT, class Real, class System>
STICTION_HD StoredRows<Real> residual_rows(TeamT&, const EnvView<Real>& env, const System&) {
  return {&env};
}
template <Team TeamT, class Real>
STICTION_HD FactorRows<Real> residual_rows(TeamT& team, const EnvView<Real>& env, const FactorSystem<Real>& s) {
  double* const velocity = s.exact;
  for_each(team, env.dofs, [&](Index k) {
    double sum = 0.0;
    for (Index i = 0; i < env.n; ++i)
      sum = fma_(static_cast<double>(env.factor[static_cast<Offset>(i) * env.dofs + k]),
                 static_cast<double>(env.lambda[i]), sum);
    velocity[k] = sum;
  });
  return {&env, velocity};
}

/// Converts a double to a Real, or some. What lies beyond Real's range becomes its largest number, and so does what is
/// no number (infinity less infinity), so that every output is finite.
template <class Real, class Wide>
STICTION_HD Real saturated(Wide value) {
  constexpr bool kIsFloat = sizeof(Scalar<Real>) == sizeof(float);
  constexpr double kLargest = kIsFloat ? static_cast<double>(__FLT_MAX__) : __DBL_MAX__;
  return narrowed<Real>(select(value == value, clamp_(value, Wide(-kLargest), Wide(kLargest)), Wide(kLargest)));
}

/// What a judge sees of an answer.
struct FinalResidual {
  double residual = 0.0;  ///< the largest of a cone's natural map [w]
  double rounding_floor =
      0.0;  ///< what rounding hides of it: of the largest number in a difference, or of a square [w]
};

/// What squares hide of any number but zero, at least.
inline constexpr double kHiddenBySquares = 0x1p-480;

/// What rounding hides of a cone's natural map of (x, y). A contact without a reaction obeys Coulomb's law, and that
/// of boxed friction, if it does not move inward, however fast it slides.
///
/// The map's norm is the root of a sum of squares. Each of at most 2 kMaxConeRows roundings near zero is off by half
/// of the smallest subnormal, 2^-1075. So a norm of 2^-535 may come out as zero. Held against 2^-480 or more, that is
/// less than a rounding.
///
/// Nor may a square overflow: de Saxce's shift, the norm of y's tangential part, would be infinite and let any contact
/// go. Of at most kMaxConeRows numbers up to 2^510 the squares have a finite sum; beyond that all is hidden.
template <Law kLaw, class Real, int M>
STICTION_HD Real rounding_floor_of(const Real (&x)[M], const Real (&y)[M], Real a, Mask<Real> is_boxed) {
  Real reaction(0);
  Real size = abs_(y[0]);
  for (int k = 0; k < M; ++k) reaction = max_(abs_(a * x[k]), reaction);
  Real tangential(0);
  for (int k = 1; k < M; ++k) tangential = max_(abs_(y[k]), tangential);
  const auto is_open = and_(reaction == Real(0), y[0] >= Real(0));
  if constexpr (kLaw == Law::coulomb) {
    tangential = select(tangential > Real(0x1p510), Real(__builtin_huge_val()), tangential);
    size = select(is_open, size, max_(tangential, size));
  } else {
    size = select(and_(is_boxed, is_open), size, max_(tangential, size));
  }
  const Real largest = max_(reaction, size);
  return select(largest > Real(0), max_(Real(0x1p-53) * largest, Real(kHiddenBySquares)), Real(0));
}

/// The largest square of a natural map so far, and the largest rounding floor.
template <class Real>
struct LargestResidual {
  Real square{0};
  Real rounding_floor{0};

  /// Adds a cone's, of (x, y). Where all of its numbers are so small that squares hide them, norms inside the map
  /// vanish, too, and it may come out as zero. It counts as 2^-532 then, more than such norms can be off by.
  template <Law kLaw, class Shape, int M>
  STICTION_HD void add(Shape shape, const Real (&x)[M], const Real (&y)[M], Real a, Real lo, Real hi) {
    const auto is_boxed = Shape::kKind == ConeKind::friction ? lo < Real(0) : Real(0) < Real(0);
    add(natural_map_square<kLaw>(shape, x, y, a, lo, hi), rounding_floor_of<kLaw>(x, y, a, is_boxed));
  }
  /// Adds that of a cone of semidefinite.
  template <int M>
  STICTION_HD void add_semidefinite(const Real (&x)[M], const Real (&y)[M], Real a) {
    add(semidefinite_map_square(x, y, a), rounding_floor_of<Law::convex>(x, y, a, Real(0) < Real(0)));
  }

 private:
  STICTION_HD void add(Real own_square, Real own_floor) {
    square = max_(own_square, square);
    square = select(own_floor == Real(kHiddenBySquares), max_(Real(0x1p-1064), square), square);
    rounding_floor = max_(own_floor, rounding_floor);
  }
};

/// A reaction in the coordinates of the unit cone; an axis without friction carries none.
template <class Real>
STICTION_HD Real unit_reaction(Real lambda, Real mu) {
  return select(mu > Real(0), div_(lambda, mu), Real(0));
}

/// The residual that may be held against `allowed`: where roundings hide more than that, what they hide. A reaction so
/// large that b is lost beside it would otherwise pass for exact (docs/math/residual.md). With `allowed` = 0, which any
/// rounding is more than, only a square that overflows counts; that counts whatever is allowed.
STICTION_HD double reported_residual(const FinalResidual& evaluated, double allowed) {
  const bool is_hidden = allowed > 0.0 && evaluated.rounding_floor > allowed;
  const bool counts = is_hidden || !finite_(evaluated.rounding_floor);
  const bool is_blind = counts && evaluated.rounding_floor > evaluated.residual;
  return is_blind ? evaluated.rounding_floor : evaluated.residual;
}

/// Motion and natural-map residual of the reactions in env.lambda, in double whatever the solve's precision, from the
/// batch's own numbers (docs/math/residual.md). Writes env.w. kMatrices: there may be cones of semidefinite; without it
/// they count as friction cones, which no method that is given one reports.
template <bool kMatrices = false, Team TeamT, class Real, class Rows>
STICTION_HD_SHARED FinalResidual final_residual(TeamT& team, const EnvView<Real>& env, const Rows& rows) {
  LargestResidual<double> largest;
  for_each(team, env.cone_count, [&](Index cone) {
    const ConeKind kind = env.kind[cone];
    const Index first = env.cone_row(cone);
    with_shape(kind, env.cone_size(cone), [&](auto shape) {
      constexpr int kRows = decltype(shape)::kRows;
      double x[kRows];
      double y[kRows];
      double diagonal_sum = 0.0;
      for (int k = 0; k < kRows; ++k) {
        const Index i = env.row_of(first, kRows, k);
        const double motion = rows.motion(i, row_start(env, i));
        const double diagonal = rows.diagonal(i, static_cast<double>(env.R[i]));
        if (env.w != nullptr) env.w[i] = canonical_zero(saturated<Real>(motion));
        diagonal_sum = diagonal_sum + diagonal;
        // Unit-cone coordinates; the motion of an axis without friction does not count.
        const double mu = static_cast<double>(row_scale(env, kind, k, i));
        x[k] = unit_reaction(static_cast<double>(env.lambda[i]), mu);
        y[k] = mu * motion;
      }
      const double a = residual_weight(div_(diagonal_sum, static_cast<double>(kRows)));
      if constexpr (kMatrices && kMayBeMatrix<decltype(shape)>) {
        if (kind == ConeKind::semidefinite) {
          largest.add_semidefinite(x, y, a);
          return;
        }
      }
      const double lo = kind == ConeKind::box            ? static_cast<double>(lower_bound(env, first))
                        : kind == ConeKind::box_friction ? -1.0
                                                         : 0.0;
      const double hi = kind == ConeKind::box ? static_cast<double>(upper_bound(env, first)) : 0.0;
      if (env.law == Law::coulomb) {
        largest.template add<Law::coulomb>(shape, x, y, a, lo, hi);
      } else {
        largest.template add<Law::convex>(shape, x, y, a, lo, hi);
      }
    });
  });
  const double residual = sqrt_(team.max(largest.square));
  return {residual, team.max(largest.rounding_floor)};
}
template <Team TeamT, class Real>
STICTION_HD FinalResidual final_residual(TeamT& team, const EnvView<Real>& env) {
  return final_residual(team, env, StoredRows<Real>{&env});
}

/// The denominator of the relative residual: max|b|, or the smallest positive scale the judge uses when b = 0.
template <Team TeamT, class Real>
STICTION_HD_OUTLINE double residual_scale(TeamT& team, const EnvView<Real>& env) {
  const double largest = max_over<double>(team, env.n, [&](Index i) { return abs_(static_cast<double>(env.b[i])); });
  return max_(largest, 1e-300);
}

}  // namespace stiction::inline STICTION_ISA
