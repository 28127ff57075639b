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

/// Converts a double to a Real, or some. What lies beyond Real's range becomes its largest number, and so does what is
/// no number (infinity less infinity), so that every output is finite.
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

/// The unit roundoff of a precision.
template <class Real>
inline constexpr double kUnitRoundoff = sizeof(Scalar<Real>) == sizeof(float) ? 0x1p-24 : 0x1p-53;

/// The scale of an environment's errors.
struct ErrorScale {
  double largest = 1e-300;  ///< of all islands [w]
  double unit = 1.0;        ///< power of two near its inverse: motions times it have squares that are numbers
};
/// A power of two that brings numbers like `largest` near 1.
STICTION_HD double error_unit(double largest) {
  if (largest < 0x1p-1000) return largest > 0.0 ? 0x1p1000 : 1.0;
  return unit_scale(largest);
}

/// `largest`: the largest island's scale, 0 where nothing is needed.
STICTION_HD ErrorScale error_scale(double largest) {
  return {max_(largest, 1e-300), error_unit(largest)};
}

/// What a judge sees of an answer.
struct FinalResidual {
  double residual =
      0.0;  ///< largest error of contacts that can move, each over its island's share of the largest scale [w]
  double stuck = 0.0;           ///< that of those that cannot: no reaction helps them [w]
  double absolute = 0.0;        ///< largest error of a contact [w]
  double rounding_floor = 0.0;  ///< what roundings hide of the first: of the largest number in a difference [w]
  double reaction = 0.0;        ///< the largest reaction as the motion that it causes alone, in the same shares [w]
};

/// The largest squares so far, in units of 1 / ErrorScale::unit.
template <class Real>
struct LargestResidual {
  Real square{0};
  Real stuck{0};
  Real plain{0};
  Real size{0};
  Real reaction{0};

  /// Adds a cone's, of (x, y) in coordinates of the unit cone. `share`: the largest island's scale over that of its
  /// own, negative of a cone that cannot move.
  template <Law kLaw, class Shape, int M>
  STICTION_HD void add(Shape shape, Real (&x)[M], Real (&y)[M], const ConeMetric<Real, M>& metric, Real lo, Real hi,
                       Real share, Real unit) {
    scale(x, y, unit);
    const Real low = Shape::kKind == ConeKind::friction ? lo : lo * unit;
    const Real own = law_error_square<kLaw>(shape, x, y, metric, low, hi * unit);
    add(own, share);
    add_sizes(x, y, metric, share, own == Real(0));
  }
  /// Adds that of a cone of semidefinite. `a`: its mean diagonal.
  template <int M>
  STICTION_HD void add_semidefinite(Real (&x)[M], Real (&y)[M], Real a, Real share, Real unit) {
    scale(x, y, unit);
    const Real own = semidefinite_error_square(x, y, a);
    add(own, share);
    Real most(0), pressed(0);
    for (int k = 0; k < M; ++k) {
      most = max_(abs_(y[k]), most);
      pressed = max_(abs_(a * x[k]), pressed);
    }
    const auto is_open = and_(pressed == Real(0), own == Real(0));
    see(pressed * pressed, select(is_open, Real(0), most * most), share);
  }
  /// Takes in what other lanes have seen.
  STICTION_HD void add(const LargestResidual& other) {
    square = max_(other.square, square);
    stuck = max_(other.stuck, stuck);
    plain = max_(other.plain, plain);
    size = max_(other.size, size);
    reaction = max_(other.reaction, reaction);
  }

 private:
  template <int M>
  static STICTION_HD void scale(Real (&x)[M], Real (&y)[M], Real unit) {
    for (int k = 0; k < M; ++k) {
      x[k] = x[k] * unit;
      y[k] = y[k] * unit;
    }
  }
  STICTION_HD void add(Real own, Real share) {
    plain = max_(own, plain);
    const Real weighted = (own * share) * share;
    const auto is_stuck = share < Real(0);
    square = max_(select(is_stuck, Real(0), weighted), square);
    stuck = max_(select(is_stuck, weighted, Real(0)), stuck);
  }
  STICTION_HD void see(Real pressed, Real moved, Real share) {
    const Real weight = share * share;
    reaction = max_(pressed * weight, reaction);
    size = max_(max_(pressed, moved) * weight, size);
  }
  /// A contact that is open, without a reaction and without an error, stays so however its motion is rounded.
  template <int M>
  STICTION_HD void add_sizes(const Real (&x)[M], const Real (&y)[M], const ConeMetric<Real, M>& metric, Real share,
                             Mask<Real> has_no_error) {
    const Real normal = metric.a * x[0];
    Real pressed = normal * normal, moved = y[0] * y[0];
    for (int k = 1; k < M; ++k) {
      const Real own = metric.a * x[k];
      pressed = max_((metric.press[k] * own) * own, pressed);
      moved = max_((metric.slip[k] * y[k]) * y[k], moved);
    }
    const auto is_open = and_(pressed == Real(0), has_no_error);
    see(pressed, select(is_open, Real(0), moved), share);
  }
};

/// What is seen of one environment, from its largest squares.
STICTION_HD FinalResidual final_residual_of(const LargestResidual<double>& largest, const ErrorScale& scale) {
  return {div_(sqrt_(largest.square), scale.unit), div_(sqrt_(largest.stuck), scale.unit),
          div_(sqrt_(largest.plain), scale.unit), div_(0x1p-53 * sqrt_(largest.size), scale.unit),
          div_(sqrt_(largest.reaction), scale.unit)};
}
/// Over a team's lanes.
template <Team TeamT>
STICTION_HD FinalResidual final_residual_of(TeamT& team, const LargestResidual<double>& own, const ErrorScale& scale) {
  LargestResidual<double> largest;
  largest.square = team.max(own.square);
  largest.stuck = team.max(own.stuck);
  largest.plain = team.max(own.plain);
  largest.size = team.max(own.size);
  largest.reaction = team.max(own.reaction);
  return final_residual_of(largest, scale);
}

/// What an answer's error is held against.
struct Allowance {
  double tolerance;  ///< on the relative residual [-]
  double absolute;   ///< on the absolute one [w]
};
/// How an answer stands.
struct Verdict {
  double relative;     ///< residual over its island's scale, or what roundings hide of it [-]
  double absolute;     ///< largest error of a contact [w]
  bool is_solved;      ///< one of them is as small as allowed
  bool is_rounding;    ///< neither, and roundings of the reactions are what is left
  bool is_infeasible;  ///< neither, for contacts alone that cannot move; all others are as near as allowed
  /// Whether no other method could do better.
  [[nodiscard]] STICTION_HD bool is_final() const { return is_solved || is_rounding || is_infeasible; }
  /// How the environment ended, `otherwise` where none of these is so.
  [[nodiscard]] STICTION_HD EnvCode code(EnvCode otherwise) const {
    return is_solved       ? EnvCode::solved
           : is_infeasible ? EnvCode::infeasible
           : is_rounding   ? EnvCode::rounding
                           : otherwise;
  }
};

/// Roundings of the reactions, times this, may be all that is left of a residual.
inline constexpr double kRoundingReach = 16.0;

/// The verdict on an answer in precision Real. A reaction so large that b is lost beside it would pass for exact, so
/// where roundings hide more than is allowed, they count (docs/math/residual.md). With a tolerance of 0 every rounding
/// does more than that; then a square that overflows counts alone.
template <class Real>
STICTION_HD Verdict judge(const FinalResidual& found, double scale, const Allowance& allowed) {
  const double most = allowed.tolerance * scale;
  const bool is_hidden = most > 0.0 && found.rounding_floor > most;
  const bool counts = (is_hidden || !finite_(found.rounding_floor)) && found.rounding_floor > found.residual;
  const double movable = counts ? found.rounding_floor : found.residual;
  Verdict verdict;
  const double relative = div_(max_(found.stuck, movable), scale);
  verdict.relative = relative == relative ? relative : __builtin_huge_val();
  verdict.absolute = counts && found.rounding_floor > found.absolute ? found.rounding_floor : found.absolute;
  verdict.is_solved =
      finite_(verdict.absolute) &&
      ((finite_(verdict.relative) && verdict.relative <= allowed.tolerance) || verdict.absolute <= allowed.absolute);
  verdict.is_infeasible =
      !verdict.is_solved && finite_(found.stuck) && found.stuck > movable && div_(movable, scale) <= allowed.tolerance;
  const double rounding = kUnitRoundoff<Real> * found.reaction;
  verdict.is_rounding = !verdict.is_solved && most > 0.0 && finite_(verdict.relative) && found.stuck <= movable &&
                        (is_hidden || (rounding > most && found.residual <= kRoundingReach * rounding));
  return verdict;
}

/// A reaction in the coordinates of the unit cone; an axis without friction carries none.
template <class Real>
STICTION_HD Real unit_reaction(Real lambda, Real mu) {
  return select(mu > Real(0), div_(lambda, mu), Real(0));
}

/// The metric of a cone from the diagonal of its rows in double, and its mean.
template <class Shape, class Real, class Rows>
STICTION_HD ConeMetric<double, Shape::kRows> cone_metric(Shape, const EnvView<Real>& env, const Rows& rows, Index cone,
                                                         double& mean) {
  constexpr int kRows = Shape::kRows;
  const Index first = env.cone_row(cone);
  ConeMetric<double, kRows> metric;
  double sum = 0.0;
  for (int k = 0; k < kRows; ++k) {
    const Index i = env.row_of(first, kRows, k);
    const double d = rows.diagonal(i, static_cast<double>(env.R[i]));
    sum = sum + d;
    if (k == 0) metric.a = d > 0.0 ? d : rows.largest(i);
    const auto weights = axis_weights(metric.a, d, static_cast<double>(row_scale(env, env.kind[cone], k, i)));
    metric.press[k] = weights.press;
    metric.slip[k] = weights.slip;
  }
  mean = residual_weight(div_(sum, static_cast<double>(kRows)));
  return metric;
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

/// Adds the error of a cone with motion(row, batch row) and reaction(batch row).
template <bool kMatrices, class Real, class Rows, class Motion, class Reaction>
STICTION_HD void add_cone(const EnvView<Real>& env, const Rows& rows, Index cone, double share, double unit,
                          Motion&& motion, Reaction&& reaction, LargestResidual<double>& largest) {
  const ConeKind kind = env.kind[cone];
  const Index first = env.cone_row(cone);
  with_shape(kind, env.cone_size(cone), [&](auto shape) {
    constexpr int kRows = decltype(shape)::kRows;
    double mean = 0.0;
    const auto metric = cone_metric(shape, env, rows, cone, mean);
    double x[kRows];
    double y[kRows];
    for (int k = 0; k < kRows; ++k) {
      const Index i = env.row_of(first, kRows, k);
      const double mu = static_cast<double>(row_scale(env, kind, k, i));
      // Unit-cone coordinates; the motion of an axis without friction does not count.
      x[k] = unit_reaction(reaction(i), mu);
      y[k] = mu * motion(i);
    }
    if constexpr (kMatrices && kMayBeMatrix<decltype(shape)>) {
      if (kind == ConeKind::semidefinite) {
        largest.add_semidefinite(x, y, mean, share, unit);
        return;
      }
    }
    const ConeBounds bounds = cone_bounds(env, cone);
    if (env.law == Law::coulomb) {
      largest.template add<Law::coulomb>(shape, x, y, metric, bounds.lo, bounds.hi, share, unit);
    } else {
      largest.template add<Law::convex>(shape, x, y, metric, bounds.lo, bounds.hi, share, unit);
    }
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
