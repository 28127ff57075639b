#pragma once

#include "core/algorithm/derivative/mode_system.hpp"

/// Cotangents of a solution pulled back to the numbers of its environment (docs/math/derivative.md, (9) to (12)).
namespace stiction::inline STICTION_ISA {

/// A number of a set that may be missing.
template <class Real>
STICTION_HD double given(const Real* numbers, Offset at) {
  return numbers == nullptr ? 0.0 : static_cast<double>(numbers[at]);
}

/// A number as it is stored: within the precision's range, no negative zero.
template <class Real>
STICTION_HD void put(Real* to, Offset at, double value) {
  if (to != nullptr) to[at] = canonical_zero(saturated<Real>(value));
}

/// put() of value times each number, which is finite. One loop over a row's entries, so that it takes vectors.
template <class Real>
STICTION_HD void put_multiples(Real* to, double value, const Real* numbers, Index count) {
  for (Index k = 0; k < count; ++k) to[k] = canonical_zero(saturated<Real>(value * static_cast<double>(numbers[k])));
}

/// put() of a number that has the precision of the stored one.
template <class Real>
STICTION_HD Real stored(Real value) {
  constexpr double kEnd = sizeof(Real) == sizeof(float) ? static_cast<double>(__FLT_MAX__) : __DBL_MAX__;
  constexpr auto kLargest = static_cast<Real>(kEnd);
  return canonical_zero(select(value == value, clamp_(value, -kLargest, kLargest), kLargest));
}

template <Team TeamT, class Real>
STICTION_HD void write_record(TeamT& team, const DerivativeJob<Real>& job, Offset index, const ModesFound& found,
                              double residual) {
  single(team, [&] {
    job.status[index] = {residual, found.forward_residual, found.flags, found.unknowns, found.degenerate, 0};
  });
}

/// A tangential row's cotangent by its mu, where its cone slides (docs/math/derivative.md, (12)).
STICTION_HD double by_friction(double g, double lambda, double nu, double w_bar, double w, double mu) {
  return div_(fma_(g, lambda, (nu - w_bar) * w), mu);
}
/// A box row's cotangent by its bounds, from the followers of its reaction's changes.
STICTION_HD double by_lo(const DerivativeScratch& s, Index i, ConeMode mode) {
  return mode == ConeMode::at_lo ? s.image[i] : 0.0;
}
STICTION_HD double by_hi(const DerivativeScratch& s, Index i, ConeMode mode) {
  return mode == ConeMode::at_hi ? s.image[i] : 0.0;
}

/// Cotangents of the rows' numbers and of A, of a set whose adjoint reaction nu + w_bar is in `s.nu`. `image` holds
/// followers of changes of the reactions that are not the unknowns'. All zeros where `refused`.
template <Team TeamT, class Real, class Scratch>
STICTION_HD void write_gradients(TeamT& team, const EnvView<Real>& env, const VjpJob<Real>& job, const Scratch& s,
                                 Offset set, bool refused) {
  const BatchCotangentView<Real>& to = job.gradients;
  const Offset rows = set * job.batch.row_count + env.first_row;
  const Real* const lambda = job.at.lambda + env.first_row;
  const auto nu = [&](Index i) { return refused ? 0.0 : s.nu[i]; };
  const auto reaction = [&](Index i) { return refused ? 0.0 : static_cast<double>(lambda[i]); };
  for_each(team, env.n, [&](Index i) {
    put(to.b, rows + i, nu(i));
    put(to.R, rows + i, nu(i) * reaction(i));
    if (to.A == nullptr || env.factor != nullptr) return;
    const Offset entries = set * job.batch.nonzero_count + env.row_offsets[i];
    if (nu(i) == 0.0) {
      for (Index k = 0; k < env.entries(i); ++k) to.A[entries + k] = 0;
      return;
    }
    if (env.is_full) return put_multiples(to.A + entries, s.nu[i], lambda, env.n);
    const Index* const column = env.columns(i);
    for (Index k = 0; k < env.entries(i); ++k) put(to.A, entries + k, nu(i) * reaction(column[k]));
  });
  for_each(team, env.cone_count, [&](Index cone) {
    const Index first = env.cone_row(cone), size = env.cone_size(cone);
    const auto mode = refused ? ConeMode::open : static_cast<ConeMode>(s.mode[cone]);
    const bool slides = !refused && env.kind[cone] == ConeKind::friction && mode == ConeMode::sliding;
    const bool is_box = !refused && env.kind[cone] == ConeKind::box;
    for (Index k = 0; k < size; ++k) {
      const Index i = env.row_of(first, size, k);
      double by_mu = 0.0;
      if (slides && k > 0 && env.friction(i) > Real(0))
        by_mu = by_friction(s.image[i], reaction(i), nu(i), given(job.cotangents.w, rows + i), s.w[i],
                            static_cast<double>(env.friction(i)));
      put(to.mu, rows + i, by_mu);
      put(to.lo, rows + i, is_box ? by_lo(s, i, mode) : 0.0);
      put(to.hi, rows + i, is_box ? by_hi(s, i, mode) : 0.0);
    }
  });
}

/// Cotangents of Y where A = Y Y': nu (Y' lambda)' + lambda (Y' nu)'.
template <Team TeamT, class Real>
STICTION_HD void write_factor_gradients(TeamT& team, const EnvView<Real>& env, const VjpJob<Real>& job,
                                        const DerivativeScratch& s, Offset set, bool refused) {
  if (job.gradients.factor == nullptr || env.factor == nullptr) return;
  Real* const to = job.gradients.factor + set * job.batch.factor_count + (env.factor - job.batch.factor);
  const Real* const lambda = job.at.lambda + env.first_row;
  for_each(team, env.dofs, [&](Index k) {
    const auto entry = [&](Index i) { return static_cast<Offset>(i) * env.dofs + k; };
    double moved = 0.0;
    double adjoint = 0.0;
    for (Index i = 0; !refused && i < env.n; ++i) {
      const auto y = static_cast<double>(env.factor[entry(i)]);
      moved = fma_(y, static_cast<double>(lambda[i]), moved);
      adjoint = fma_(y, s.nu[i], adjoint);
    }
    for (Index i = 0; i < env.n; ++i)
      put(to, entry(i), refused ? 0.0 : fma_(s.nu[i], moved, static_cast<double>(lambda[i]) * adjoint));
  });
}

/// The adjoint reaction of a set, of one environment or of environments side by side: solves G' y = E' (lambda_bar +
/// A' w_bar). Leaves w_bar - F y in `nu`, and lambda_bar + (A + R)'(w_bar - F y) in `image`. `K`: the factor of G'.
template <Team TeamT, class Modes, class Matrix, class Bar>
STICTION_HD auto solve_adjoint(TeamT& team, const Modes& modes, const Matrix& K, const Bar& bar) {
  using Wide = typename Modes::Wide;
  const auto& s = modes.s;
  const auto lambda_bar = [&](Index i) { return bar.by_lambda(i); };
  const auto image = [&](Index i) { return s.image[i]; };
  for_each(team, modes.rows(), [&](Index i) {
    s.image[i] = bar.by_lambda(i);
    s.nu[i] = bar.by_w(i);
  });
  if (bar.has_w()) apply_columns(team, modes, s.nu, s.image, lambda_bar);
  Wide largest(0);
  to_unknowns(team, modes, s.E, image, [&](Index k, Index, Wide value) {
    s.unknown[k] = value;
    largest = max_(abs_(value * s.row_scale[k]), largest);
  });
  solve_system(team, K, s);
  for_each(team, modes.rows(), [&](Index i) { s.nu[i] = bar.by_w(i) - from_unknowns(modes, s.F, i); });
  apply_columns(team, modes, s.nu, s.image, lambda_bar);
  Wide left(0);
  to_unknowns(team, modes, s.E, image, [&](Index k, Index slot, Wide value) {
    left = max_(abs_((value - s.D[slot] * s.unknown[k]) * s.row_scale[k]), left);
  });
  auto is_finite = finite_(Wide(0));
  for_each(team, modes.rows(),
           [&](Index i) { is_finite = and_(is_finite, and_(finite_(s.nu[i]), finite_(s.image[i]))); });
  return check_solution(team, left, largest, is_finite);
}

/// Cotangents of the solution of an environment, of a set.
template <class Real>
struct SolutionBar {
  const SolutionCotangentView<Real>& cotangents;
  Offset first_row;

  [[nodiscard]] STICTION_HD double by_lambda(Index i) const { return given(cotangents.lambda, first_row + i); }
  [[nodiscard]] STICTION_HD double by_w(Index i) const { return given(cotangents.w, first_row + i); }
  [[nodiscard]] STICTION_HD bool has_w() const { return cotangents.w != nullptr; }
};

/// Returns true if every row stores all columns in order, on every lane.
template <Team TeamT, class Real>
STICTION_HD bool stores_every_column(TeamT& team, const EnvView<Real>& env) {
  std::uint32_t others = 0;
  for_each(team, env.n, [&](Index i) {
    if (env.entries(i) != env.n || !is_run(env.columns(i), env.n)) others = 1;
  });
  return team.combine(others) == 0;
}

/// Pulls all sets of cotangents of one environment, whose directions are known, back and writes its record.
template <Team TeamT, class Real, class Scratch>
STICTION_HD void vjp_along(TeamT& team, const EnvView<Real>& env, const VjpJob<Real>& job, Offset index,
                           const Scratch& s, ModesFound found) {
  if ((found.flags & kGradientRefused) == 0) found.flags |= factor_system<true>(team, env, s, found.unknowns);
  double residual = 0.0;
  const bool refused = (found.flags & kGradientRefused) != 0;
  for (Offset set = 0; set < job.count; ++set) {
    bool broken = refused;
    if (!refused) {
      const auto own = solve_adjoint(team, modes_of(env, s), DenseMatrix{s.K, found.unknowns},
                                     SolutionBar<Real>{job.cotangents, set * job.batch.row_count + env.first_row});
      broken = !own.is_finite;
      if (broken) {
        found.flags |= kGradientNonFinite;
      } else {
        residual = max_(own.residual, residual);
      }
    }
    write_gradients(team, env, job, s, set, broken);
    write_factor_gradients(team, env, job, s, set, broken);
  }
  write_record(team, job, index, found, residual);
}

/// The environment of a job.
template <Team TeamT, class Real>
STICTION_HD EnvView<Real> environment_of(TeamT& team, const VjpJob<Real>& job, Offset index) {
  EnvView<Real> env = slice_problem(job.batch, job.law, index);
  if (team.size() > 1 && env.factor == nullptr) env.is_full = stores_every_column(team, env);
  return env;
}

/// Pulls all sets of cotangents of one environment back and writes its record.
template <Team TeamT, class Real>
STICTION_HD void vjp_env(TeamT& team, const VjpJob<Real>& job, Offset index, double* memory) {
  const EnvView<Real> env = environment_of(team, job, index);
  const DerivativeScratch s = lay_out(job, index, memory);
  vjp_along(team, env, job, index, s, find_answer(team, env, job, index, s));
}

/// Zeros for an environment that was not looked at, and its record.
template <Team TeamT, class Real>
STICTION_HD void refuse_vjp(TeamT& team, const VjpJob<Real>& job, Offset index, std::uint32_t flags) {
  const EnvView<Real> env = slice_problem(job.batch, job.law, index);
  for (Offset set = 0; set < job.count; ++set) {
    write_gradients(team, env, job, DerivativeScratch{}, set, true);
    write_factor_gradients(team, env, job, DerivativeScratch{}, set, true);
  }
  write_record(team, job, index, ModesFound{flags, 0.0, 0, 0}, 0.0);
}

}  // namespace stiction::inline STICTION_ISA
