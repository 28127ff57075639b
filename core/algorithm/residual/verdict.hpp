#pragma once

#include "core/algorithm/residual/residual_estimate.hpp"

namespace stiction::inline STICTION_ISA {

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

/// An answer's errors, as a judge sees them.
struct FinalResidual {
  double residual =
      0.0;  ///< largest error of contacts that can move, each over its island's share of the largest scale [w]
  double stuck = 0.0;           ///< that of those that cannot: no reaction helps them [w]
  double absolute = 0.0;        ///< largest error of a contact [w]
  double rounding_floor = 0.0;  ///< part of the first hidden by roundings: of the largest number in a difference [w]
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
  /// Adds the results of other lanes.
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

/// Errors of one environment, from its largest squares.
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

/// Bounds that an answer's error is held against.
struct Allowance {
  double tolerance;  ///< on the relative residual [-]
  double absolute;   ///< on the absolute one [w]
};
/// Verdict on an answer.
struct Verdict {
  double relative;     ///< residual over its island's scale, or the part hidden by roundings [-]
  double absolute;     ///< largest error of a contact [w]
  bool is_solved;      ///< one of them is as small as allowed
  bool is_rounding;    ///< neither, and only roundings of the reactions are left
  bool is_infeasible;  ///< neither, for contacts alone that cannot move; all others are as near as allowed
  /// Returns true if no other method could do better.
  [[nodiscard]] STICTION_HD bool is_final() const { return is_solved || is_rounding || is_infeasible; }
  /// Returns the environment's outcome, or `otherwise` where none applies.
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

}  // namespace stiction::inline STICTION_ISA
