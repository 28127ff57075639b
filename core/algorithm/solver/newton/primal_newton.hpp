#pragma once

#include "core/algorithm/linear/line_search.hpp"
#include "core/algorithm/newton/cone_response.hpp"
#include "core/algorithm/solver/newton/primal_matrix_free.hpp"

/// Newton's method for the convex law with compliance on every row. It minimises phi(zeta) = zeta'A zeta / 2 + psi(A
/// zeta + b), where psi is the compliant cones' response (docs/math/newton.md). In exact arithmetic these are the
/// iterates of Newton's method on the velocity, v = v_free + M^-1 J' zeta, as MuJoCo and SAP have it. But A is all it
/// needs.
namespace stiction::inline STICTION_ISA {

/// Part of the slope at the beginning of a line that may be left where it ends.
inline constexpr double kSlopeLeft = 1e-3;

template <class Shape, class System>
STICTION_HD CompliantPoint<Shape::kRows> point_at(Shape shape, const System& s, Index cone, Index row,
                                                  const double (&u)[Shape::kRows], double (&R)[Shape::kRows]) {
  read_cone(newton_room(s).vector(kCompliance), row, R);
  double lo = 0.0;
  double hi = 0.0;
  if constexpr (Shape::kKind == ConeKind::box) {
    lo = static_cast<double>(s.lo[cone]);
    hi = static_cast<double>(s.hi[cone]);
  }
  return compliant_point(shape, u, R, lo, hi);
}

/// Takes the compliance from A + R, and s.x as the first point.
template <Team TeamT, class System>
STICTION_HD_OUTLINE void start_primal(TeamT& team, System& s) {
  const NewtonWorkspace workspace = newton_room(s);
  const DenseMatrix A = workspace.matrix(0);
  double* const R = workspace.vector(kCompliance);
  if (workspace.has_matrices) fill_matrix(team, s, A);
  s.for_each_cone(team, [&](auto shape, Index cone, Index row) {
    constexpr int kRows = decltype(shape)::kRows;
    for (int k = 0; k < kRows; ++k) {
      double& diagonal = workspace.has_matrices ? A(row + k, row + k) : workspace.vector(kDiagonal)[row + k];
      if (!workspace.has_matrices) diagonal = static_cast<double>(s.block_entry(row, k, k));
      diagonal = diagonal - R[row + k];
      // An axis without friction has no motion here either, and any compliance keeps its reaction at zero.
      if (!(R[row + k] > 0.0)) R[row + k] = R[row];
      workspace.vector(kPoint)[row + k] = static_cast<double>(s.x[row + k]);
    }
    workspace.vector(kContactStates)[cone] = -1.0;
  });
  renew_motion<false>(team, s, kPoint, kMotion);
}

/// Gap zeta - x(u) and the factor C of every cone; whether the matrix factored last is another one now.
template <Team TeamT, class System>
STICTION_HD_OUTLINE bool linearise(TeamT& team, System& s) {
  const NewtonWorkspace workspace = newton_room(s);
  double changed = 0.0;
  s.for_each_cone(team, [&](auto shape, Index cone, Index row) {
    constexpr int kRows = decltype(shape)::kRows;
    double u[kRows];
    double R[kRows];
    double C[kRows][kRows];
    read_cone(workspace.vector(kMotion), row, u);
    const CompliantPoint<kRows> point = point_at(shape, s, cone, row, u, R);
    compliance_factor(shape, point, R, C);
    for (int k = 0; k < kRows; ++k) {
      workspace.vector(kGap)[row + k] = workspace.vector(kPoint)[row + k] - point.x[k];
      for (int j = 0; j < kRows; ++j) workspace.vector(kFactor)[Offset{6} * (row + k) + j] = C[k][j];
    }
    if constexpr (kMultipliesWide<System>)
      if (!workspace.has_matrices) guess_unknown(shape, workspace, row, point, R, C);
    double& contact_state = workspace.vector(kContactStates)[cone];
    const auto now = static_cast<double>(point.contact_state);
    if (contact_state != now || point.contact_state == kSliding) changed = 1.0;
    contact_state = now;
  });
  return team.max(changed) > 0.0;
}

/// The second matrix becomes the factors of I + C'AC; its cones' blocks are factored where it has no room.
template <Team TeamT, class System>
STICTION_HD_OUTLINE void factor_curvature(TeamT& team, const System& s) {
  const NewtonWorkspace workspace = newton_room(s);
  if constexpr (kMultipliesWide<System>)
    if (!workspace.has_matrices) {
      prepare_curvature(team, s);
      return;
    }
  const DenseMatrix A = workspace.matrix(0);
  const DenseMatrix K = workspace.matrix(1);
  const double* const C = workspace.vector(kFactor);
  SerialTeam alone;
  s.for_each_cone(alone, [&](auto shape, Index, Index row) {
    constexpr int kRows = decltype(shape)::kRows;
    for (int j = 0; j < kRows; ++j) {
      double c[kRows];
      bool is_zero = true;
      for (int k = 0; k < kRows; ++k) {
        c[k] = C[Offset{6} * (row + k) + j];
        is_zero = is_zero && c[k] == 0.0;
      }
      // Most cones of a robot are open or at a bound, and the columns of such are zero.
      for (Index i = team.rank(); i < s.n; i += team.size()) {
        double sum = 0.0;
        for (int k = 0; !is_zero && k < kRows; ++k) sum = fma_(A(i, row + k), c[k], sum);
        K(i, row + j) = sum;
      }
    }
  });
  team.sync();
  // The lower triangle is all that is read.
  for_each(team, s.n, [&](Index j) {
    s.for_each_cone(alone, [&](auto shape, Index, Index row) {
      constexpr int kRows = decltype(shape)::kRows;
      if (row + kRows <= j) return;
      double sum[kRows];
      for (int i = 0; i < kRows; ++i) {
        sum[i] = row + i == j ? 1.0 : 0.0;
        for (int k = 0; k < kRows; ++k) sum[i] = fma_(C[Offset{6} * (row + k) + i], K(row + k, j), sum[i]);
      }
      for (int i = 0; i < kRows; ++i) K(row + i, j) = sum[i];
    });
  });
  factor_ldl(team, K, 0.0);
}

/// kUnknown, the right-hand side, becomes the solution: of the factored matrix, or to `accuracy` by gradients.
template <Team TeamT, class System>
STICTION_HD void solve_curvature(TeamT& team, const System& s, double accuracy) {
  const NewtonWorkspace workspace = newton_room(s);
  if constexpr (kMultipliesWide<System>)
    if (!workspace.has_matrices) {
      solve_curvature_by_gradients(team, s, accuracy);
      return;
    }
  solve_ldl(team, workspace.matrix(1), workspace.vector(kUnknown));
}

/// d = -r + C t with (I + C'AC) t = C'A r, and A d. Gradients solve for the difference of t from a guess.
template <Team TeamT, class System>
STICTION_HD_OUTLINE void find_direction(TeamT& team, const System& s, double accuracy) {
  const NewtonWorkspace workspace = newton_room(s);
  double* const image = workspace.vector(kImage);
  double* const t = workspace.vector(kUnknown);
  double* const d = workspace.vector(kStep);
  const double* const C = workspace.vector(kFactor);
  const auto zero = [](Index) { return 0.0; };
  const auto into_image = [&](Index i, double value) { image[i] = value; };
  const auto add_answers = [&](const double* unknown) {
    s.for_each_cone(team, [&](auto shape, Index, Index row) {
      constexpr int kRows = decltype(shape)::kRows;
      for (int k = 0; k < kRows; ++k)
        for (int j = 0; j < kRows; ++j) d[row + k] = fma_(C[Offset{6} * (row + k) + j], unknown[row + j], d[row + k]);
    });
  };
  for_each(team, s.n, [&](Index i) { d[i] = 0.0 - workspace.vector(kGap)[i]; });
  if (!workspace.has_matrices) add_answers(workspace.vector(kGuess));
  multiply_motion<false>(team, s, d, zero, into_image);
  s.for_each_cone(team, [&](auto shape, Index, Index row) {
    constexpr int kRows = decltype(shape)::kRows;
    for (int j = 0; j < kRows; ++j) {
      double sum = 0.0;
      for (int k = 0; k < kRows; ++k) sum = fma_(C[Offset{6} * (row + k) + j], image[row + k], sum);
      t[row + j] = 0.0 - sum;
      if (!workspace.has_matrices) t[row + j] = t[row + j] - workspace.vector(kGuess)[row + j];
    }
  });
  solve_curvature(team, s, accuracy);
  add_answers(t);
  multiply_motion<false>(team, s, d, zero, into_image);
}

/// phi' and phi'' on the line, at zeta + alpha d.
template <Team TeamT, class System>
STICTION_HD_OUTLINE LinePoint evaluate_along(TeamT& team, const System& s, double alpha) {
  const NewtonWorkspace workspace = newton_room(s);
  s.for_each_cone(team, [&](auto shape, Index cone, Index row) {
    constexpr int kRows = decltype(shape)::kRows;
    double u[kRows];
    double d[kRows];
    double image[kRows];
    double zeta[kRows];
    double R[kRows];
    double C[kRows][kRows];
    read_cone(workspace.vector(kStep), row, d);
    read_cone(workspace.vector(kImage), row, image);
    read_cone(workspace.vector(kPoint), row, zeta);
    read_cone(workspace.vector(kMotion), row, u);
    for (int k = 0; k < kRows; ++k) u[k] = fma_(alpha, image[k], u[k]);
    const CompliantPoint<kRows> point = point_at(shape, s, cone, row, u, R);
    compliance_factor(shape, point, R, C);
    double slope = 0.0;
    double curvature = 0.0;
    for (int k = 0; k < kRows; ++k) {
      slope = fma_(image[k], fma_(alpha, d[k], zeta[k]) - point.x[k], slope);
      curvature = fma_(image[k], d[k], curvature);
    }
    for (int j = 0; j < kRows; ++j) {
      double sum = 0.0;
      for (int k = 0; k < kRows; ++k) sum = fma_(C[k][j], image[k], sum);
      curvature = fma_(sum, sum, curvature);
    }
    workspace.vector(kConeSlope)[cone] = slope;
    workspace.vector(kConeCurvature)[cone] = curvature;
  });
  const double slope = sum_values(team, workspace.vector(kConeSlope), s.cones);
  return {slope, sum_values(team, workspace.vector(kConeCurvature), s.cones)};
}

/// Rounding of a slope: 4 eps times the sum of the magnitudes it is made of. A stiff row answers to the rounding of
/// its motion as it does to motion.
template <Team TeamT, class System>
STICTION_HD_OUTLINE double slope_noise(TeamT& team, const System& s) {
  const NewtonWorkspace workspace = newton_room(s);
  const double terms = sum_leaves<double>(team, [&](Index leaf) {
    double sum = 0.0;
    for (Index i = leaf; i < s.n; i += kReduceLeaves) {
      const double reaction = abs_(workspace.vector(kPoint)[i]);
      const double motion = fma_(workspace.diagonal(i), reaction, abs_(workspace.vector(kMotion)[i]));
      const double answer = reaction + div_(motion, workspace.vector(kCompliance)[i]);
      sum = fma_(abs_(workspace.vector(kImage)[i]), answer, sum);
    }
    return sum;
  });
  return 0x1p-50 * terms;
}

/// One iteration. Returns whether there was nothing left to gain but rounding, on every lane.
template <Team TeamT, class System>
STICTION_HD_OUTLINE bool iterate_primal(TeamT& team, System& s) {
  using Real = typename System::Real;
  const NewtonWorkspace workspace = newton_room(s);
  if (linearise(team, s)) factor_curvature(team, s);
  find_direction(team, s, kPrimalAccuracy);
  double noise = slope_noise(team, s);
  LinePoint here = evaluate_along(team, s, 0.0);
  if (!workspace.has_matrices && !(here.slope < 0.0 - noise)) {
    find_direction(team, s, kPrimalCare);
    noise = slope_noise(team, s);
    here = evaluate_along(team, s, 0.0);
  }
  const bool is_exhausted = !(here.slope < 0.0 - noise);
  const double alpha =
      is_exhausted ? 1.0
                   : search_line([&](double at) { return evaluate_along(team, s, at); }, here.slope, kSlopeLeft, noise);
  for_each(team, s.n, [&](Index i) {
    workspace.vector(kPoint)[i] = fma_(alpha, workspace.vector(kStep)[i], workspace.vector(kPoint)[i]);
  });
  renew_motion<false>(team, s, kPoint, kMotion);
  s.for_each_cone(team, [&](auto shape, Index cone, Index row) {
    constexpr int kRows = decltype(shape)::kRows;
    double u[kRows];
    double R[kRows];
    read_cone(workspace.vector(kMotion), row, u);
    const CompliantPoint<kRows> point = point_at(shape, s, cone, row, u, R);
    for (int k = 0; k < kRows; ++k) s.x[row + k] = static_cast<Real>(point.x[k]);
  });
  return is_exhausted;
}

}  // namespace stiction::inline STICTION_ISA
