#pragma once

#include "core/algorithm/linear/dense/dense_lu.hpp"
#include "core/algorithm/solver/newton/cone_derivative.hpp"
#include "core/algorithm/solver/newton/proximal_matrix_free.hpp"
#include "core/algorithm/solver/npgs.hpp"

/// Semismooth Newton on the natural map with a proximal term: Coulomb's law, and the convex law where some row has no
/// compliance (docs/math/newton.md). It converges from nearby. Sweeps with momentum therefore bring it there, at the
/// beginning and whenever a step does not make the natural map smaller. The term is then weighted more again.
namespace stiction::inline STICTION_ISA {

inline constexpr int kSweepsBefore = 10;  ///< sweeps at the beginning and when Newton's method is of no use
inline constexpr int kBacktracks = 6;
/// State between iterations, behind that of the sweeps.
enum NewtonState : Index {
  kProximalWeight = static_cast<Index>(Npgs::kStateEnd),  ///< 0: the primal method; negative: sweeps come first
  kWasExhausted,  ///< primal: 1 if the last step could gain nothing but rounding
  kNewtonStateEnd
};
static_assert(kNewtonStateEnd <= static_cast<Index>(kStateScalars));

inline constexpr float kProximalStart = 1e-2F;  ///< weight of the proximal term over the mean diagonal
inline constexpr float kProximalMost = 1.0F;    ///< the same at most
inline constexpr float kProximalFall = 0.3F;    ///< its factor once the problem with it is solved, and where no step
inline constexpr float kProximalRise = 3.0F;    ///< makes it smaller
inline constexpr float kProximalLeast = 1e-12F;
/// Part of the natural map that the proximal problem may leave before its centre moves.
inline constexpr double kInnerPart = 0.1;

/// One cone of the natural map x - P(x - D g), g the motion with de Saxce's and the proximal term.
template <int M>
struct ProximalPoint {
  double gap[M];
  double z[M];    ///< point that is projected
  double weight;  ///< 1 / D: the gap in units of w
  double lo, hi;
};

template <Law kLaw, class Shape, class System, int M>
STICTION_HD_OUTLINE ProximalPoint<M> proximal_gap(Shape shape, const System& s, Index cone, const double (&x)[M],
                                                  const double (&y)[M], const double (&prox_center)[M],
                                                  double prox_weight) {
  ProximalPoint<M> point;
  const double D = natural_step(s, cone);
  point.weight = div_(1.0, D);
  point.lo = point.hi = 0.0;
  if constexpr (Shape::kKind == ConeKind::box) {
    point.lo = static_cast<double>(s.lo[cone]);
    point.hi = static_cast<double>(s.hi[cone]);
  }
  double shift = 0.0;
  if constexpr (Shape::kKind == ConeKind::friction)
    if (law_of<kLaw>(s) == Law::coulomb) shift = tangential_norm<M>(y);
  double g[M];
  double projected[M];
  for (int k = 0; k < M; ++k) {
    g[k] = fma_(prox_weight, x[k] - prox_center[k], k == 0 ? y[k] + shift : y[k]);
    point.z[k] = projected[k] = fma_(0.0 - D, g[k], x[k]);
  }
  double still[M] = {};
  proximal_point(shape, projected, still, 0.0, point.lo, point.hi, Law::convex);
  for (int k = 0; k < M; ++k) point.gap[k] = x[k] - projected[k];
  return point;
}

/// Squared length of the natural map, in units of w, without and with the proximal term.
struct Merit {
  double natural;
  double proximal;
};
template <Law kLaw, Team TeamT, class System>
STICTION_HD_OUTLINE Merit merit_at(TeamT& team, const System& s, Index point, Index motion, double prox_weight) {
  const NewtonWorkspace workspace = newton_room(s);
  s.for_each_cone(team, [&](auto shape, Index cone, Index row) {
    constexpr int kRows = decltype(shape)::kRows;
    double x[kRows];
    double y[kRows];
    double prox_center[kRows];
    read_cone(workspace.vector(point), row, x);
    read_cone(workspace.vector(motion), row, y);
    read_cone(workspace.vector(kProxCenter), row, prox_center);
    const auto squares = [&](double weight) {
      const ProximalPoint<kRows> at = proximal_gap<kLaw>(shape, s, cone, x, y, prox_center, weight);
      double sum = 0.0;
      for (int k = 0; k < kRows; ++k) sum = fma_(at.gap[k], at.gap[k], sum);
      return (sum * at.weight) * at.weight;
    };
    workspace.vector(kConeSlope)[cone] = squares(0.0);
    workspace.vector(kConeCurvature)[cone] = squares(prox_weight);
  });
  const double natural = sum_values(team, workspace.vector(kConeSlope), s.cones);
  return {natural, sum_values(team, workspace.vector(kConeCurvature), s.cones)};
}

/// Gap and derivative of the proximal natural map: the second matrix becomes F', its cones' blocks where it has no
/// room.
template <Law kLaw, Team TeamT, class System>
STICTION_HD_OUTLINE void linearise_proximal(TeamT& team, const System& s, double prox_weight) {
  const NewtonWorkspace workspace = newton_room(s);
  const DenseMatrix A = workspace.matrix(0);
  const DenseMatrix K = workspace.matrix(1);
  double* const d = workspace.vector(kStep);
  s.for_each_cone(team, [&](auto shape, Index cone, Index row) {
    constexpr int kRows = decltype(shape)::kRows;
    double x[kRows];
    double y[kRows];
    double prox_center[kRows];
    read_cone(workspace.vector(kPoint), row, x);
    read_cone(workspace.vector(kMotion), row, y);
    read_cone(workspace.vector(kProxCenter), row, prox_center);
    const ProximalPoint<kRows> at = proximal_gap<kLaw>(shape, s, cone, x, y, prox_center, prox_weight);
    NaturalSlope<kRows> slope{{}, {}, div_(1.0, at.weight), prox_weight};
    projection_derivative(shape, at.z, at.lo, at.hi, slope.P);
    if constexpr (decltype(shape)::kKind == ConeKind::friction) {
      const double length = law_of<kLaw>(s) == Law::coulomb ? tangential_norm<kRows>(y) : 0.0;
      if (length > 0.0)
        for (int k = 1; k < kRows; ++k) slope.turn[k] = div_(y[k], length);
    }
    for (int k = 0; k < kRows; ++k) d[row + k] = 0.0 - at.gap[k];
    if constexpr (kMultipliesWide<System>)
      if (!workspace.has_matrices) {
        prepare_slope(s, row, slope);
        return;
      }
    for (Index j = 0; j < s.n; ++j) {
      double own[kRows];
      double image[kRows];
      double entry[kRows];
      for (int k = 0; k < kRows; ++k) {
        own[k] = row + k == j ? 1.0 : 0.0;
        image[k] = A(row + k, j);
      }
      slope.apply(own, image, entry);
      for (int k = 0; k < kRows; ++k) K(row + k, j) = entry[k];
    }
  });
}

/// kStep, the right-hand side, becomes the solution.
template <Team TeamT, class System>
STICTION_HD_OUTLINE void solve_natural(TeamT& team, const System& s, double prox_weight) {
  const NewtonWorkspace workspace = newton_room(s);
  if constexpr (kMultipliesWide<System>)
    if (!workspace.has_matrices) {
      solve_natural_by_gradients(team, s, prox_weight);
      return;
    }
  factor_lu(team, workspace.matrix(1), workspace.vector(kPivots));
  solve_lu(team, workspace.matrix(1), workspace.vector(kPivots), workspace.vector(kStep));
}

/// Mean diagonal of A + R, the unit of the proximal term's weight.
template <class Real, Team TeamT>
STICTION_HD_OUTLINE Real mean_diagonal(TeamT& team, const NewtonWorkspace& workspace) {
  const double diagonal_sum = sum_leaves<double>(team, [&](Index leaf) {
    double sum = 0.0;
    for (Index i = leaf; i < workspace.n; i += kReduceLeaves) sum = sum + workspace.diagonal(i);
    return sum;
  });
  const double mean = div_(diagonal_sum, static_cast<double>(workspace.n));
  return static_cast<Real>(mean > 0.0 ? mean : 1.0);
}

/// Takes A + R as a matrix of doubles, or its diagonal. The weight of the proximal term is negative until the first
/// sweeps are done. It is never zero, which marks the primal method, however small the diagonal.
template <Team TeamT, class System>
STICTION_HD_OUTLINE void start_proximal(TeamT& team, System& s) {
  using Real = typename System::Real;
  const NewtonWorkspace workspace = newton_room(s);
  if (workspace.has_matrices) {
    fill_matrix(team, s, workspace.matrix(0));
  } else {
    s.for_each_cone(team, [&](auto shape, Index, Index row) {
      for (int k = 0; k < decltype(shape)::kRows; ++k)
        workspace.vector(kDiagonal)[row + k] = static_cast<double>(s.block_entry(row, k, k));
    });
  }
  const Real mean = mean_diagonal<Real>(team, workspace);
  single(team, [&] {
    s.scalar[Npgs::kTheta] = Real(0);
    s.scalar[kProximalWeight] = Real(0) - max_(Real(kProximalStart) * mean, Real(kProximalLeast));
  });
}

/// Sweeps with momentum from s.x, which becomes the next point and the centre of the proximal term. Theta is zero if
/// Newton's method has moved x since the last sweep: then there is no momentum to go on with.
template <Law kLaw, Team TeamT, class System>
STICTION_HD_OUTLINE void sweep_closer(TeamT& team, System& s,
                                      const MethodParams<Scalar<typename System::Real>>& params) {
  using Real = typename System::Real;
  const NewtonWorkspace workspace = newton_room(s);
  const bool afresh = s.scalar[Npgs::kTheta] == Real(0);
  team.sync();
  if (afresh) {
    refresh_motion(team, s);
    Npgs::start<kLaw>(team, s);
  }
  for (int k = 0; k < kSweepsBefore; ++k) Npgs::iterate<kLaw>(team, s, params);
  Npgs::refresh(team, s, true);
  for_each(team, s.n, [&](Index i) {
    workspace.vector(kPoint)[i] = workspace.vector(kProxCenter)[i] = static_cast<double>(s.x[i]);
  });
  renew_motion<true>(team, s, kPoint, kMotion);
}

/// The point `length` along d, projected onto the cones, and its motion.
template <Team TeamT, class System>
STICTION_HD_OUTLINE void try_step(TeamT& team, const System& s, double length) {
  const NewtonWorkspace workspace = newton_room(s);
  s.for_each_cone(team, [&](auto shape, Index cone, Index row) {
    constexpr int kRows = decltype(shape)::kRows;
    double x[kRows];
    double still[kRows] = {};
    for (int k = 0; k < kRows; ++k)
      x[k] = fma_(length, workspace.vector(kStep)[row + k], workspace.vector(kPoint)[row + k]);
    proximal_point(shape, x, still, 0.0, static_cast<double>(s.lo[cone]), static_cast<double>(s.hi[cone]), Law::convex);
    for (int k = 0; k < kRows; ++k) workspace.vector(kTrial)[row + k] = x[k];
  });
  renew_motion<true>(team, s, kTrial, kTrialMotion);
}

/// The natural map that rounding leaves of a solution, squared.
template <Team TeamT, class System>
STICTION_HD_OUTLINE double merit_noise(TeamT& team, const System& s) {
  const NewtonWorkspace workspace = newton_room(s);
  const double terms = sum_leaves<double>(team, [&](Index leaf) {
    double sum = 0.0;
    for (Index i = leaf; i < s.n; i += kReduceLeaves) {
      const double term = workspace.diagonal(i) * workspace.vector(kPoint)[i];
      sum = fma_(term, term, sum);
    }
    return sum;
  });
  return 0x1p-100 * terms;
}

/// One iteration. Returns whether there was nothing left to gain but rounding, on every lane.
template <Law kLaw, Team TeamT, class System>
STICTION_HD_OUTLINE bool iterate_proximal(TeamT& team, System& s,
                                          const MethodParams<Scalar<typename System::Real>>& params) {
  using Real = typename System::Real;
  const NewtonWorkspace workspace = newton_room(s);
  const Real weight = s.scalar[kProximalWeight];
  team.sync();
  if (weight < Real(0)) sweep_closer<kLaw>(team, s, params);
  const auto prox_weight = static_cast<double>(abs_(weight));
  const Merit here = merit_at<kLaw>(team, s, kPoint, kMotion, prox_weight);
  const double noise = merit_noise(team, s);
  linearise_proximal<kLaw>(team, s, prox_weight);
  solve_natural(team, s, prox_weight);
  double length = 1.0;
  Merit there = here;
  bool is_better = false;
  for (int trial = 0; trial <= kBacktracks && !is_better; ++trial) {
    if (trial > 0) length = 0.5 * length;
    try_step(team, s, length);
    there = merit_at<kLaw>(team, s, kTrial, kTrialMotion, prox_weight);
    is_better = there.proximal < (1.0 - 1e-4 * length) * here.proximal;
  }
  const bool is_solved = is_better && there.proximal <= (kInnerPart * kInnerPart) * there.natural;
  if (is_better) {
    for_each(team, s.n, [&](Index i) {
      const double x = workspace.vector(kTrial)[i];
      workspace.vector(kPoint)[i] = x;
      workspace.vector(kMotion)[i] = workspace.vector(kTrialMotion)[i];
      if (is_solved) workspace.vector(kProxCenter)[i] = x;
      s.x[i] = static_cast<Real>(x);
    });
  }
  Real next = abs_(weight);
  if (is_solved) next = max_(next * Real(kProximalFall), Real(kProximalLeast));
  if (!is_better) {
    const Real most = Real(kProximalMost) * mean_diagonal<Real>(team, workspace);
    next = max_(next, min_(next * Real(kProximalRise), most));
  }
  single(team, [&] {
    if (is_better) s.scalar[Npgs::kTheta] = Real(0);
    s.scalar[kProximalWeight] = next;
  });
  if (!is_better) sweep_closer<kLaw>(team, s, params);
  return !is_better && here.natural <= noise;
}

}  // namespace stiction::inline STICTION_ISA
