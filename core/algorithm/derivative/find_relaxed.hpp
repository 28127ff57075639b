#pragma once

#include "core/algorithm/derivative/mode_system.hpp"
#include "core/algorithm/derivative/relaxed_cone.hpp"

/// The relaxed problem of an environment, in double whatever the batch's precision. Newton's method on its smooth
/// natural map begins at the reactions of the exact one (docs/math/derivative.md, (22) to (27)).
namespace stiction::inline STICTION_ISA {

/// Scratch of one environment, with the relaxed problem's arrays beside.
struct RelaxedScratch : DerivativeScratch {
  double* lambda;    ///< relaxed reactions                               (n)
  double* kept;      ///< those before a step                             (n)
  double* step;      ///<                                                 (n)
  double* residual;  ///< of unknown k of a cone, at its first row + k    (n)
  double* lo_share;  ///< how a box row follows its lower bound           (n)
  double* hi_share;  ///< its upper one                                   (n)
};

/// Returns the doubles that an environment of so many rows needs beside its DerivativeScratch.
STICTION_HD constexpr Offset relaxed_vectors(Offset rows) {
  return 6 * rows;
}
/// Scratch of one environment, in doubles.
template <class Real>
STICTION_HD Offset relaxed_elements(const DerivativeJob<Real>& job, Offset env) {
  return derivative_elements(job, env) + relaxed_vectors(job.batch.env_rows(env));
}

template <class Real>
STICTION_HD RelaxedScratch lay_out_relaxed(const DerivativeJob<Real>& job, Offset env, double* memory) {
  const Offset n = job.batch.env_rows(env);
  RelaxedScratch s;
  static_cast<DerivativeScratch&>(s) = lay_out(job, env, memory);
  s.lambda = memory + derivative_elements(job, env);
  s.kept = s.lambda + n;
  s.step = s.kept + n;
  s.residual = s.step + n;
  s.lo_share = s.residual + n;
  s.hi_share = s.lo_share + n;
  return s;
}

/// A box row's cotangents and change by its bounds, both of which it follows in part.
STICTION_HD double by_lo(const RelaxedScratch& s, Index i, ConeMode) {
  return s.lo_share[i] * s.image[i];
}
STICTION_HD double by_hi(const RelaxedScratch& s, Index i, ConeMode) {
  return s.hi_share[i] * s.image[i];
}
template <class Real>
STICTION_HD double change_by_bounds(const RelaxedScratch& s, const JvpJob<Real>& job, Offset at, Index i, ConeMode) {
  const double lo = job.tangents.lo == nullptr ? 0.0 : static_cast<double>(job.tangents.lo[at]);
  const double hi = job.tangents.hi == nullptr ? 0.0 : static_cast<double>(job.tangents.hi[at]);
  return fma_(s.lo_share[i], lo, s.hi_share[i] * hi);
}

/// Distance of reactions from the relaxed problem's.
struct RelaxedPoint {
  double square;  ///< sum of the squares of the smooth natural map
  double size;    ///< of the numbers that it is a difference of
  Index unknowns;

  [[nodiscard]] STICTION_HD bool is_within(double share) const { return square <= (share * size) * (share * size); }
};

/// Motion, smooth natural map and directions at the reactions in `s.lambda`.
template <Team TeamT, class Real, class Rows>
STICTION_HD_OUTLINE RelaxedPoint evaluate_relaxed(TeamT& team, const EnvView<Real>& env, const Relaxing& relaxing,
                                                  const Rows& rows, const RelaxedScratch& s) {
  apply_rows(
      team, modes_of(env, s), s.lambda, [&](Index i) { return static_cast<double>(env.b[i]); },
      [&](Index i, double value) { s.w[i] = value; });
  double size = 0.0;
  for_each(team, env.cone_count, [&](Index cone) {
    const Index first = env.cone_row(cone);
    with_shape(env.kind[cone], env.cone_size(cone), [&](auto shape) {
      std::uint32_t flags = 0;  // of numbers that were looked at before
      const auto point = cone_point(shape, env, rows, s.lambda, s.w, cone, flags);
      const auto found = relaxed_cone(shape, point, relaxing);
      write_directions(env, s, cone, first, found.directions);
      for (int k = 0; k < decltype(shape)::kRows; ++k) {
        s.residual[first + k] = found.residual[k];
        s.lo_share[first + k] = found.lo_share;
        s.hi_share[first + k] = found.hi_share;
      }
      size = max_(found.size, size);
    });
  });
  RelaxedPoint point;
  point.size = team.max(size);
  point.square = sum_leaves<double>(team, [&](Index leaf) {
    double sum = 0.0;
    for (Index i = leaf; i < env.n; i += kReduceLeaves) sum = fma_(s.residual[i], s.residual[i], sum);
    return sum;
  });
  point.unknowns = scan_unknowns(team, s.first, env.cone_count, s.parts);
  list_moving_rows(team, env, s, point.unknowns);
  return point;
}

/// Newton's step at the point that was evaluated last, to `s.step`. Returns whether the system has one.
template <Team TeamT, class Real>
STICTION_HD bool relaxed_step(TeamT& team, const EnvView<Real>& env, const RelaxedScratch& s, Index unknowns) {
  const std::uint32_t flags = factor_system<false>(team, env, s, unknowns);
  for_each(team, env.cone_count, [&](Index cone) {
    const Index first = s.first[cone], row = env.cone_row(cone);
    for (Index k = 0; k < s.first[cone + 1] - first; ++k) s.unknown[first + k] = 0.0 - s.residual[row + k];
  });
  solve_system(team, DenseMatrix{s.K, unknowns}, s);
  for_each(team, env.n, [&](Index i) { s.step[i] = from_unknowns(modes_of(env, s), s.E, i); });
  return (flags & kGradientSingular) == 0;
}

/// Relative residuals that Newton's method aims at, and that must be reached.
inline constexpr double kRelaxedAim = 1e-13, kRelaxedLimit = 1e-9;
inline constexpr int kRelaxedSteps = 100, kRelaxedHalvings = 30;

/// Newton's method from `s.lambda`, each step halved until the map shrinks. Returns flags, on every lane.
template <Team TeamT, class Real, class Rows>
STICTION_HD std::uint32_t solve_relaxed(TeamT& team, const EnvView<Real>& env, const Relaxing& relaxing,
                                        const Rows& rows, const RelaxedScratch& s, RelaxedPoint point) {
  const auto move = [&](double length) {
    for_each(team, env.n, [&](Index i) { s.lambda[i] = fma_(length, s.step[i], s.kept[i]); });
    return evaluate_relaxed(team, env, relaxing, rows, s);
  };
  for (int step = 0; step < kRelaxedSteps && !point.is_within(kRelaxedAim); ++step) {
    if (!relaxed_step(team, env, s, point.unknowns)) return kGradientSingular;
    for_each(team, env.n, [&](Index i) { s.kept[i] = s.lambda[i]; });
    // Once only roundings are left, half a step is no better than a whole one.
    const int halvings = point.is_within(kRelaxedLimit) ? 1 : kRelaxedHalvings;
    double length = 1.0;
    bool is_better = false;
    RelaxedPoint next = point;
    for (int k = 0; k < halvings && !is_better; ++k) {
      next = move(length);
      is_better = next.square < (1.0 - 1e-4 * length) * point.square;
      length = 0.5 * length;
    }
    if (!is_better) {
      point = move(0.0);
      break;
    }
    point = next;
  }
  return point.is_within(kRelaxedLimit) ? 0U : static_cast<std::uint32_t>(kGradientUnconverged);
}

/// Reactions, motions and directions of the relaxed problem, and whether its derivative can be had. The reactions go to
/// `out` as well; those of an environment that is refused are the exact ones.
template <Team TeamT, class Real>
STICTION_HD ModesFound find_relaxed(TeamT& team, const EnvView<Real>& env, const DerivativeJob<Real>& job, Offset index,
                                    double kappa, Real* out, const RelaxedScratch& s) {
  ModesFound found = find_answer(team, env, job, index, s);
  // Nothing is between two modes where there are none.
  found.flags &= ~static_cast<std::uint32_t>(kGradientSubgradient);
  const Real* const given = job.at.lambda + env.first_row;
  for_each(team, env.n, [&](Index i) {
    out[env.first_row + i] = given[i];
    s.lambda[i] = static_cast<double>(given[i]);
  });
  if ((found.flags & kGradientRefused) != 0) return found;
  const Relaxing relaxing{job.law, kappa,
                          max_over<double>(team, env.n, [&](Index i) { return abs_(static_cast<double>(env.b[i])); })};
  const auto relax = [&](const auto& rows) {
    const RelaxedPoint point = evaluate_relaxed(team, env, relaxing, rows, s);
    found.unknowns = point.unknowns;
    if (point.unknowns > most_unknowns(job, index)) {
      found.flags |= kGradientOverCapacity;
    } else {
      found.flags |= solve_relaxed(team, env, relaxing, rows, s, point);
    }
  };
  if (env.factor == nullptr) {
    relax(StoredRows<Real>{&env});
  } else {
    relax(FactorRows<Real>{&env, nullptr});
  }
  if ((found.flags & kGradientRefused) == 0)
    for_each(team, env.n, [&](Index i) { out[env.first_row + i] = saturated<Real>(s.lambda[i]); });
  return found;
}

}  // namespace stiction::inline STICTION_ISA
