#pragma once

#include "core/algorithm/solver/ipm/ipm_step.hpp"

/// Mehrotra's predictor and corrector over cones and bounds (docs/math/ipm.md).
namespace stiction::inline STICTION_ISA {

/// Part of the step to the boundary that is taken.
inline constexpr double kBoundaryPart = 0.995;
/// Complementarity that a cone keeps, relative to x_n z_n. Below that, a sliding contact's x and z are on the boundary
/// in doubles.
inline constexpr double kThinnestMargin = 0x1p-48;

/// The sum of all products of slacks and multipliers.
template <Team TeamT, class System>
STICTION_HD_OUTLINE double complementarity(TeamT& team, const System& s, const IpmSpace& p) {
  s.for_each_cone(team, [&](auto shape, Index, Index row) {
    using Shape = decltype(shape);
    if constexpr (Shape::kKind == ConeKind::friction) {
      for (int k = 0; k < Shape::kRows; ++k) p.work[row + k] = p.lambda[row + k] * p.lambda[row + k];
    } else {
      p.work[row] = fma_(p.slack[row], p.z[row], p.upper_slack[row] * p.upper_z[row]);
    }
  });
  return sum_values(team, p.work, p.n);
}

/// The part of a step to the boundary of which the largest reciprocal is known.
STICTION_HD double step_length(double reciprocal, double part) {
  return reciprocal > part ? div_(part, reciprocal) : 1.0;
}

/// The step towards complementarity zero. Leaves it in p.affine and returns how much of the complementarity the
/// corrector may aim at: (gap that it would leave / gap)^3.
template <Team TeamT, class System>
STICTION_HD_OUTLINE double predict(TeamT& team, const System& s, const IpmSpace& p, double gap) {
  s.for_each_cone(team, [&](auto shape, Index cone, Index row) {
    using Shape = decltype(shape);
    double v[Shape::kRows];
    for (int k = 0; k < Shape::kRows; ++k) v[k] = 0.0 - p.motion[row + k];
    if constexpr (Shape::kKind == ConeKind::friction) {
      p.template scaling<Shape::kRows>(row).to_frame(v);
    } else if (row_bounds(shape, s, cone).is_fixed()) {
      v[0] = 0.0;
    }
    store(v, p.force, row);
  });
  solve_step(team, s, p, kPredictorAccuracy);
  double reciprocal = 0.0;
  s.for_each_cone(team, [&](auto shape, Index, Index row) {
    using Shape = decltype(shape);
    constexpr int kRows = Shape::kRows;
    if constexpr (Shape::kKind == ConeKind::friction) {
      const ConeScaling<kRows> scaling = p.template scaling<kRows>(row);
      double d[kRows];
      scaled_step<kRows>(scaling, p, row, d);
      store(d, p.affine, row);
      double dual[kRows];
      for (int k = 0; k < kRows; ++k) dual[k] = 0.0 - scaling.lambda[k] - d[k];
      reciprocal = max_(reciprocal_step<kRows>(scaling.lambda, d), reciprocal);
      reciprocal = max_(reciprocal_step<kRows>(scaling.lambda, dual), reciprocal);
    } else {
      const double lower = div_(p.step[row], p.slack[row]);
      const double upper = div_(p.step[row], p.upper_slack[row]);
      p.affine[row] = p.step[row];
      if (p.z[row] > 0.0) reciprocal = max_(max_(0.0 - lower, 1.0 + lower), reciprocal);
      if (p.upper_z[row] > 0.0) reciprocal = max_(max_(upper, 1.0 - upper), reciprocal);
    }
  });
  const double t = step_length(team.max(reciprocal), 1.0);
  s.for_each_cone(team, [&](auto shape, Index, Index row) {
    using Shape = decltype(shape);
    if constexpr (Shape::kKind == ConeKind::friction) {
      for (int k = 0; k < Shape::kRows; ++k) {
        const double scaled = p.lambda[row + k];
        const double d = p.affine[row + k];
        p.work[row + k] = fma_(t, d, scaled) * fma_(t, 0.0 - scaled - d, scaled);
      }
    } else {
      const double d = p.affine[row];
      const double lower = p.z[row] * (1.0 - t * (1.0 + div_(d, p.slack[row])));
      const double upper = p.upper_z[row] * (1.0 - t * (1.0 - div_(d, p.upper_slack[row])));
      p.work[row] = fma_(t, d, p.slack[row]) * lower + fma_(t, 0.0 - d, p.upper_slack[row]) * upper;
    }
  });
  const double left = max_(sum_values(team, p.work, p.n), 0.0);
  const double ratio = left < gap ? div_(left, gap) : (gap > 0.0 ? 1.0 : 0.0);
  return ratio * ratio * ratio;
}

/// W^-1 of the solution of the linear system, rotated.
template <int M>
STICTION_HD void scaled_step(const ConeScaling<M>& scaling, const IpmSpace& p, Index row, double (&d)[M]) {
  for (int k = 0; k < M; ++k) d[k] = p.step[row + k] * scaling.inverse_eigenvalues[k];
  ConeScaling<M>::to_sum_difference(d);
}

/// The step to complementarity `target` with the predictor's second-order term, taken as far as the cones allow.
template <Team TeamT, class System>
STICTION_HD_OUTLINE void correct(TeamT& team, const System& s, const IpmSpace& p, double target) {
  s.for_each_cone(team, [&](auto shape, Index cone, Index row) {
    using Shape = decltype(shape);
    constexpr int kRows = Shape::kRows;
    double v[kRows];
    if constexpr (Shape::kKind == ConeKind::friction) {
      const ConeScaling<kRows> scaling = p.template scaling<kRows>(row);
      double d[kRows];
      double dual[kRows];
      double aim[kRows];
      load(p.affine, row, d);
      for (int k = 0; k < kRows; ++k) {
        dual[k] = 0.0 - scaling.lambda[k] - d[k];
        aim[k] = k == 0 ? max_(target, kThinnestMargin * (p.x[row] * p.z[row])) : 0.0;
        v[k] = p.z[row + k] - p.motion[row + k];
      }
      subtract_jordan_product<kRows>(aim, scaling.lambda, scaling.lambda);
      subtract_jordan_product<kRows>(aim, d, dual);
      jordan_divide<kRows>(scaling.lambda, aim);
      store(aim, p.affine, row);
      scaling.to_frame(v);
      ConeScaling<kRows>::to_sum_difference(aim);
      for (int k = 0; k < kRows; ++k) v[k] = fma_(scaling.inverse_eigenvalues[k], aim[k], v[k]);
    } else {
      const double d = p.affine[row];
      const double lower = div_(d, p.slack[row]);
      const double upper = div_(d, p.upper_slack[row]);
      p.lambda[row] = p.z[row] > 0.0 ? target + d * (p.z[row] * (1.0 + lower)) : 0.0;
      p.inverse_eigenvalues[row] = p.upper_z[row] > 0.0 ? target - d * (p.upper_z[row] * (1.0 - upper)) : 0.0;
      v[0] = (div_(p.lambda[row], p.slack[row]) - div_(p.inverse_eigenvalues[row], p.upper_slack[row])) - p.motion[row];
      if (row_bounds(shape, s, cone).is_fixed()) v[0] = 0.0;
    }
    store(v, p.force, row);
  });
  solve_step(team, s, p, kCorrectorAccuracy);
  double reciprocal = 0.0;
  s.for_each_cone(team, [&](auto shape, Index, Index row) {
    using Shape = decltype(shape);
    constexpr int kRows = Shape::kRows;
    if constexpr (Shape::kKind == ConeKind::friction) {
      const ConeScaling<kRows> scaling = p.template scaling<kRows>(row);
      double d[kRows];
      double dual[kRows];
      scaled_step<kRows>(scaling, p, row, d);
      for (int k = 0; k < kRows; ++k) dual[k] = p.affine[row + k] - d[k];
      reciprocal = max_(reciprocal_step<kRows>(scaling.lambda, d), reciprocal);
      reciprocal = max_(reciprocal_step<kRows>(scaling.lambda, dual), reciprocal);
      double point[kRows];
      load(p.step, row, point);
      scaling.from_frame(point);
      store(point, p.step, row);
      // W^-1 of the scaled dual step, back in the cone's rows.
      ConeScaling<kRows>::to_sum_difference(dual);
      for (int k = 0; k < kRows; ++k) dual[k] = (k < 2 ? 0.5 : 1.0) * (dual[k] * scaling.inverse_eigenvalues[k]);
      scaling.from_frame(dual);
      store(dual, p.dual_step, row);
    } else {
      const double d = p.step[row];
      p.dual_step[row] = div_(p.lambda[row] - p.z[row] * d, p.slack[row]) - p.z[row];
      p.upper_step[row] = div_(p.inverse_eigenvalues[row] + p.upper_z[row] * d, p.upper_slack[row]) - p.upper_z[row];
      if (p.z[row] > 0.0)
        reciprocal = max_(max_(div_(0.0 - d, p.slack[row]), div_(0.0 - p.dual_step[row], p.z[row])), reciprocal);
      if (p.upper_z[row] > 0.0)
        reciprocal = max_(max_(div_(d, p.upper_slack[row]), div_(0.0 - p.upper_step[row], p.upper_z[row])), reciprocal);
    }
  });
  const double t = step_length(team.max(reciprocal), kBoundaryPart);
  s.for_each_cone(team, [&](auto shape, Index cone, Index row) {
    using Shape = decltype(shape);
    if constexpr (Shape::kKind == ConeKind::friction) {
      for (int k = 0; k < Shape::kRows; ++k) {
        p.x[row + k] = fma_(t, p.step[row + k], p.x[row + k]);
        p.z[row + k] = fma_(t, p.dual_step[row + k], p.z[row + k]);
      }
    } else if (!row_bounds(shape, s, cone).is_fixed()) {
      p.x[row] = fma_(t, p.step[row], p.x[row]);
      if (p.z[row] > 0.0) {
        p.slack[row] = fma_(t, p.step[row], p.slack[row]);
        p.z[row] = fma_(t, p.dual_step[row], p.z[row]);
      }
      if (p.upper_z[row] > 0.0) {
        p.upper_slack[row] = fma_(t, 0.0 - p.step[row], p.upper_slack[row]);
        p.upper_z[row] = fma_(t, p.upper_step[row], p.upper_z[row]);
      }
    }
  });
}

}  // namespace stiction::inline STICTION_ISA
