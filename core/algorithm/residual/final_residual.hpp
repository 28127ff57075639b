#pragma once

#include "core/algorithm/residual/verdict.hpp"
#include "core/base/dot4.hpp"

namespace stiction::inline STICTION_ISA {

/// Returns the start of row i's motion: b + R lambda, in double.
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

/// The largest entry of row i.
template <class Real>
STICTION_HD_OUTLINE double row_largest(const EnvView<Real>& env, Index row) {
  double largest = 0.0;
  for (Index k = 0; k < env.entries(row); ++k)
    largest = max_(abs_(static_cast<double>(env.A[env.row_offsets[row] + k])), largest);
  return largest;
}

/// Rows of A where they are stored, as the final residual reads them.
template <class Real>
struct StoredRows {
  const EnvView<Real>* env;
  [[nodiscard]] STICTION_HD double motion(Index row, double start) const { return row_motion(*env, row, start); }
  [[nodiscard]] STICTION_HD double diagonal(Index row, double start) const { return row_diagonal(*env, row, start); }
  [[nodiscard]] STICTION_HD double largest(Index row) const { return row_largest(*env, row); }
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
  /// A row of Y Y' whose diagonal is zero is zero.
  [[nodiscard]] static STICTION_HD double largest(Index) { return 0.0; }
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

/// Converts a double to a Real, or some. Values beyond Real's range become its largest number, and so do NaNs
/// (infinity less infinity), so that every output is finite.
template <class Real, class Wide>
STICTION_HD Wide within_range(Wide value) {
  constexpr bool kIsFloat = sizeof(Scalar<Real>) == sizeof(float);
  constexpr double kLargest = kIsFloat ? static_cast<double>(__FLT_MAX__) : __DBL_MAX__;
  return select(value == value, clamp_(value, Wide(-kLargest), Wide(kLargest)), Wide(kLargest));
}
template <class Real, class Wide>
STICTION_HD Real saturated(Wide value) {
  return narrowed<Real>(within_range<Real>(value));
}

/// A reaction in the coordinates of the unit cone; an axis without friction carries none.
template <class Real>
STICTION_HD Real unit_reaction(Real lambda, Real mu) {
  return select(mu > Real(0), div_(lambda, mu), Real(0));
}

/// A cone's answer in the coordinates of its unit cone, and the weights of its rows.
struct ConeAnswer {
  double x[kMaxConeRows];
  double y[kMaxConeRows];
  ConeMetric<double, kMaxConeRows> metric;
  double mean;  ///< of the diagonal
};

/// Reads the answer of a cone of `size` rows, with motion(batch row) and reaction(batch row).
template <class Real, class Rows, class Size, class Motion, class Reaction>
STICTION_HD ConeAnswer cone_answer(const EnvView<Real>& env, const Rows& rows, Index cone, Size size, Motion&& motion,
                                   Reaction&& reaction) {
  const ConeKind kind = env.kind[cone];
  const Index first = env.cone_row(cone);
  ConeAnswer answer;
  double sum = 0.0;
  for (Index k = 0; k < size; ++k) {
    const Index i = env.row_of(first, size, k);
    const double d = rows.diagonal(i, static_cast<double>(env.R[i]));
    const double mu = static_cast<double>(row_scale(env, kind, k, i));
    sum = sum + d;
    if (k == 0) answer.metric.a = d > 0.0 ? d : rows.largest(i);
    const auto weights = axis_weights(answer.metric.a, d, mu);
    answer.metric.press[k] = weights.press;
    answer.metric.slip[k] = weights.slip;
    // The motion of an axis without friction does not count.
    answer.x[k] = unit_reaction(reaction(i), mu);
    answer.y[k] = mu * motion(i);
  }
  answer.mean = residual_weight(div_(sum, static_cast<double>(Index{size})));
  return answer;
}

/// The bounds of a cone in double, as law_error_square() reads them.
struct ConeBounds {
  double lo, hi;
};
template <class Real>
STICTION_HD ConeBounds cone_bounds(const EnvView<Real>& env, Index cone) {
  const ConeKind kind = env.kind[cone];
  const Index first = env.cone_row(cone);
  if (kind == ConeKind::box)
    return {static_cast<double>(lower_bound(env, first)), static_cast<double>(upper_bound(env, first))};
  return {kind == ConeKind::box_friction ? -1.0 : 0.0, 0.0};
}

/// Adds the error of an answer of a cone of `rows` rows. kMatrices: it may be one of semidefinite.
template <bool kMatrices>
STICTION_HD_PART void add_answer(ConeKind kind, Index rows, Law law, const ConeAnswer& answer, const ConeBounds& bounds,
                                 double share, double unit, LargestResidual<double>& largest) {
  with_shape(kind, rows, [&](auto shape) {
    constexpr int kRows = decltype(shape)::kRows;
    ConeMetric<double, kRows> metric;
    double x[kRows];
    double y[kRows];
    metric.a = answer.metric.a;
    for (int k = 0; k < kRows; ++k) {
      metric.press[k] = answer.metric.press[k];
      metric.slip[k] = answer.metric.slip[k];
      x[k] = answer.x[k];
      y[k] = answer.y[k];
    }
    if constexpr (kMatrices && kMayBeMatrix<decltype(shape)>) {
      if (kind == ConeKind::semidefinite) {
        largest.add_semidefinite(x, y, answer.mean, share, unit);
        return;
      }
    }
    if (law == Law::coulomb) {
      largest.template add<Law::coulomb>(shape, x, y, metric, bounds.lo, bounds.hi, share, unit);
    } else {
      largest.template add<Law::convex>(shape, x, y, metric, bounds.lo, bounds.hi, share, unit);
    }
  });
}

/// Adds the error of a cone with motion(batch row) and reaction(batch row).
template <bool kMatrices, class Real, class Rows, class Motion, class Reaction>
STICTION_HD void add_cone(const EnvView<Real>& env, const Rows& rows, Index cone, double share, double unit,
                          Motion&& motion, Reaction&& reaction, LargestResidual<double>& largest) {
  with_row_count(env.kind[cone], env.cone_size(cone), [&](auto size) {
    const ConeAnswer answer = cone_answer(env, rows, cone, size, motion, reaction);
    add_answer<kMatrices>(env.kind[cone], size, env.law, answer, cone_bounds(env, cone), share, unit, largest);
  });
}

/// Motion and error of the reactions in env.lambda, in double whatever the solve's precision, from the batch's own
/// numbers (docs/math/residual.md). Writes env.w. share(cone): the largest island's scale over that of the cone's.
/// kMatrices: there may be cones of semidefinite; without it they count as friction cones, which no method that is
/// given one reports.
template <bool kMatrices = false, Team TeamT, class Real, class Rows, class Share>
STICTION_HD_SHARED FinalResidual final_residual(TeamT& team, const EnvView<Real>& env, const Rows& rows,
                                                const Share& share, const ErrorScale& scale) {
  LargestResidual<double> largest;
  for_each(team, env.cone_count, [&](Index cone) {
    add_cone<kMatrices>(
        env, rows, cone, share(cone), scale.unit,
        [&](Index i) {
          const double motion = rows.motion(i, row_start(env, i));
          if (env.w != nullptr) env.w[i] = canonical_zero(saturated<Real>(motion));
          return motion;
        },
        [&](Index i) { return static_cast<double>(env.lambda[i]); }, largest);
  });
  return final_residual_of(team, largest, scale);
}

}  // namespace stiction::inline STICTION_ISA
