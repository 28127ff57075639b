#pragma once

#include "core/algorithm/derivative/cone_mode.hpp"
#include "core/algorithm/derivative/mode_products.hpp"
#include "core/algorithm/residual/final_residual.hpp"
#include "core/team/reduce.hpp"

namespace stiction::inline STICTION_ISA {

/// Facts about an environment before its system is solved.
struct ModesFound {
  std::uint32_t flags;
  double forward_residual;
  Index unknowns;
  Index degenerate;
};

/// Numbers of a row that a solve would have refused.
template <class Real>
STICTION_HD std::uint32_t row_flags(const EnvView<Real>& env, ConeKind kind, Index k, Index row) {
  bool is_finite = true;
  bool is_valid = !(env.R[row] < Real(0));
  if (carries_friction(kind) && k > 0) {
    is_finite = finite_(env.friction(row));
    is_valid = is_valid && !(env.friction(row) < Real(0));
  }
  if (kind == ConeKind::box) {
    is_finite = env.lo[row] == env.lo[row] && env.hi[row] == env.hi[row];
    is_valid = is_valid && !(env.lo[row] > env.hi[row]);
  }
  return is_finite && is_valid ? 0U : static_cast<std::uint32_t>(kGradientInvalidInput);
}

/// A cone of the batch in the coordinates of the unit cone, at the reactions; adds to `flags` reasons against a solve.
template <class Shape, class Real, class Rows, class Reaction>
STICTION_HD auto cone_point(Shape, const EnvView<Real>& env, const Rows& rows, const Reaction* lambda, const double* w,
                            Index cone, std::uint32_t& flags) {
  const ConeKind kind = env.kind[cone];
  const Index first = env.cone_row(cone);
  constexpr int kRows = Shape::kRows;
  ModePoint<kRows> point;
  double diagonal = 0.0;
  for (int k = 0; k < kRows; ++k) {
    const Index i = env.row_of(first, kRows, k);
    flags |= row_flags(env, kind, k, i);
    if (!finite_(lambda[i]) || !finite_(w[i])) flags |= kGradientNonFinite;
    diagonal = diagonal + rows.diagonal(i, static_cast<double>(env.R[i]));
    const auto mu = static_cast<double>(row_scale(env, kind, k, i));
    point.mu[k] = mu > 0.0 ? mu : 0.0;
    point.x[k] = unit_reaction(static_cast<double>(lambda[i]), mu);
    point.y[k] = point.mu[k] * w[i];
  }
  point.a = residual_weight(div_(diagonal, static_cast<double>(kRows)));
  point.lo = Shape::kKind == ConeKind::box ? static_cast<double>(lower_bound(env, first)) : 0.0;
  point.hi = Shape::kKind == ConeKind::box ? static_cast<double>(upper_bound(env, first)) : 0.0;
  return point;
}

/// The error scale of a cone alone, in units of 1 / unit: its error at b.
template <class Real, class Rows>
STICTION_HD double cone_error_at_rest(const EnvView<Real>& env, const Rows& rows, Index cone, double unit) {
  LargestResidual<double> own;
  double largest = 0.0;
  add_cone<false>(
      env, rows, cone, 1.0, unit,
      [&](Index i) {
        const double b = static_cast<double>(env.b[i]);
        largest = max_(abs_(b * unit), largest);
        return b;
      },
      [](Index) { return 0.0; }, own);
  return max_(sqrt_(own.square), static_cast<double>(kIdleShare) * largest);
}

/// Writes a cone's directions where its rows are; its number of unknowns goes to `first`, to be scanned.
template <int M, class Real>
STICTION_HD void write_directions(const EnvView<Real>& env, const DerivativeScratch& s, Index cone, Index row,
                                  const ConeDirections<M>& found) {
  s.first[cone] = found.unknowns;
  s.mode[cone] = static_cast<Index>(found.mode);
  s.degenerate[cone] = found.is_degenerate ? 1 : 0;
  for (int k = 0; k < M; ++k) {
    const Index i = env.row_of(row, M, k);
    s.cone_of_row[i] = cone;
    s.D[row + k] = found.D[k];
    for (int c = 0; c < kMaxConeRows; ++c) {
      s.E[static_cast<Offset>(i) * kMaxConeRows + c] = c < M ? found.E[k][c] : 0.0;
      s.F[static_cast<Offset>(i) * kMaxConeRows + c] = c < M ? found.F[k][c] : 0.0;
    }
  }
}

/// Returns true if the environment came with an answer.
template <class Real>
STICTION_HD std::uint32_t answer_flags(const EnvView<Real>& env, const DerivativeJob<Real>& job, Offset index) {
  std::uint32_t flags = 0;
  if ((env.flags & ~static_cast<std::uint32_t>(kFlagContactsDropped)) != 0) flags |= kGradientInvalidInput;
  if (job.at.status != nullptr && job.at.status[index].code != EnvCode::solved) flags |= kGradientUnconverged;
  return flags;
}

/// Writes the first unknown of each cone; returns their number. One lane needs no parts for that.
template <Team TeamT>
STICTION_HD Index scan_unknowns(TeamT& team, Index* first, Index cones, Index* parts) {
  if constexpr (requires { requires TeamT::size() == 1; }) {
    Index sum = 0;
    for (Index cone = 0; cone < cones; ++cone) {
      const Index own = first[cone];
      first[cone] = sum;
      sum += own;
    }
    return sum;
  } else {
    return exclusive_scan(team, first, cones, parts);
  }
}

/// Cones between two modes.
template <Team TeamT>
STICTION_HD Index count_degenerate(TeamT& team, const DerivativeScratch& s, Index cones) {
  if constexpr (requires { requires TeamT::size() == 1; }) {
    Index sum = 0;
    for (Index cone = 0; cone < cones; ++cone) sum += s.degenerate[cone];
    return sum;
  } else {
    return static_cast<Index>(sum_leaves<double>(team, [&](Index leaf) {
      double sum = 0.0;
      for (Index cone = leaf; cone < cones; cone += kReduceLeaves) sum = sum + static_cast<double>(s.degenerate[cone]);
      return sum;
    }));
  }
}

/// Closes the list of unknowns and lists the rows of cones that have some.
template <Team TeamT, class Real>
STICTION_HD void list_moving_rows(TeamT& team, const EnvView<Real>& env, const DerivativeScratch& s, Index unknowns) {
  single(team, [&] {
    s.first[env.cone_count] = unknowns;
    Index count = 0;
    for (Index i = 0; i < env.n; ++i) {
      s.moving[count] = i;
      count += s.first[s.cone_of_row[i] + 1] > s.first[s.cone_of_row[i]] ? 1 : 0;
    }
    s.moving[env.n] = count;
  });
}

/// Modes and directions of all cones at the motion in `s.w`, and whether the environment's derivative can be had.
template <Team TeamT, class Real, class Rows>
STICTION_HD ModesFound find_modes_at_motion(TeamT& team, const EnvView<Real>& env, const DerivativeJob<Real>& job,
                                            Offset index, const Rows& rows, const DerivativeScratch& s) {
  const Real* const lambda = job.at.lambda + env.first_row;
  const double scale = max_over<double>(team, env.n, [&](Index i) { return abs_(static_cast<double>(env.b[i])); });
  const double tie = job.tie_tolerance * scale;
  std::uint32_t flags = answer_flags(env, job, index);
  const double unit = error_unit(scale);
  LargestResidual<double> largest;
  double at_rest = 0.0;
  for_each(team, env.cone_count, [&](Index cone) {
    const Index first = env.cone_row(cone);
    if (env.kind[cone] >= ConeKind::box_friction) flags |= kGradientInvalidInput;
    add_cone<false>(
        env, rows, cone, 1.0, unit, [&](Index i) { return s.w[i]; },
        [&](Index i) { return static_cast<double>(lambda[i]); }, largest);
    at_rest = max_(cone_error_at_rest(env, rows, cone, unit), at_rest);
    with_shape(env.kind[cone], env.cone_size(cone), [&](auto shape) {
      const auto point = cone_point(shape, env, rows, lambda, s.w, cone, flags);
      const auto found = cone_directions(shape, point, job.law, tie);
      write_directions(env, s, cone, first, found);
    });
  });
  ModesFound result;
  // Over the largest island's scale: where islands differ the solve has judged each by its own.
  result.forward_residual = div_(sqrt_(team.max(largest.square)), max_(team.max(at_rest), 1e-300));
  if (!(result.forward_residual <= job.residual_limit)) flags |= kGradientUnconverged;
  result.unknowns = scan_unknowns(team, s.first, env.cone_count, s.parts);
  result.degenerate = count_degenerate(team, s, env.cone_count);
  list_moving_rows(team, env, s, result.unknowns);
  if (result.degenerate > 0) flags |= kGradientSubgradient;
  if (result.unknowns > most_unknowns(job, index)) flags |= kGradientOverCapacity;
  result.flags = team.combine(flags);
  return result;
}

/// find_modes_at_motion() of the motion at the reactions.
template <Team TeamT, class Real, class Rows>
STICTION_HD_OUTLINE ModesFound find_modes(TeamT& team, const EnvView<Real>& env, const DerivativeJob<Real>& job,
                                          Offset index, const Rows& rows, const DerivativeScratch& s) {
  const Real* const lambda = job.at.lambda + env.first_row;
  for_each(team, env.n, [&](Index i) { s.seed[i] = static_cast<double>(lambda[i]); });
  apply_rows(
      team, modes_of(env, s), s.seed, [&](Index i) { return static_cast<double>(env.b[i]); },
      [&](Index i, double value) { s.w[i] = value; });
  return find_modes_at_motion(team, env, job, index, rows, s);
}

template <Team TeamT, class Real>
STICTION_HD ModesFound find_answer(TeamT& team, const EnvView<Real>& env, const DerivativeJob<Real>& job, Offset index,
                                   const DerivativeScratch& s) {
  if (env.factor == nullptr) return find_modes(team, env, job, index, StoredRows<Real>{&env}, s);
  return find_modes(team, env, job, index, FactorRows<Real>{&env, nullptr}, s);
}

}  // namespace stiction::inline STICTION_ISA
