#pragma once

#include "core/algorithm/derivative/vjp.hpp"

/// Changes of an environment's numbers pushed forward to its solution (docs/math/derivative.md, (7) and (8)).
namespace stiction::inline STICTION_ISA {

/// dA lambda of a row.
template <class Real>
STICTION_HD double row_change(const EnvView<Real>& env, const JvpJob<Real>& job, const DerivativeScratch& s, Index row,
                              Offset set) {
  const Real* const lambda = job.at.lambda + env.first_row;
  double sum = 0.0;
  if (env.factor == nullptr) {
    if (job.tangents.A == nullptr) return sum;
    const Real* const change = job.tangents.A + set * job.batch.nonzero_count + env.row_offsets[row];
    for (Index k = 0; k < env.entries(row); ++k)
      sum = fma_(static_cast<double>(change[k]), static_cast<double>(lambda[env.columns(row)[k]]), sum);
    return sum;
  }
  if (job.tangents.factor == nullptr) return sum;
  // dY (Y' lambda) + Y (dY' lambda).
  const Offset at = static_cast<Offset>(row) * env.dofs;
  const Real* const change = job.tangents.factor + set * job.batch.factor_count + (env.factor - job.batch.factor) + at;
  for (Index k = 0; k < env.dofs; ++k) {
    sum = fma_(static_cast<double>(change[k]), s.velocity[k], sum);
    sum = fma_(static_cast<double>(env.factor[at + k]), s.velocity_change[k], sum);
  }
  return sum;
}

/// Y' lambda and dY' lambda.
template <Team TeamT, class Real>
STICTION_HD void project_reactions(TeamT& team, const EnvView<Real>& env, const JvpJob<Real>& job,
                                   const DerivativeScratch& s, Offset set) {
  if (env.factor == nullptr || job.tangents.factor == nullptr) return;
  const Real* const lambda = job.at.lambda + env.first_row;
  const Real* const change = job.tangents.factor + set * job.batch.factor_count + (env.factor - job.batch.factor);
  for_each(team, env.dofs, [&](Index k) {
    double sum = 0.0;
    double changed = 0.0;
    for (Index i = 0; i < env.n; ++i) {
      const Offset at = static_cast<Offset>(i) * env.dofs + k;
      sum = fma_(static_cast<double>(env.factor[at]), static_cast<double>(lambda[i]), sum);
      changed = fma_(static_cast<double>(change[at]), static_cast<double>(lambda[i]), changed);
    }
    s.velocity[k] = sum;
    s.velocity_change[k] = changed;
  });
}

/// Returns the change of a box row's reaction by a change of its bounds.
template <class Real>
STICTION_HD double change_by_bounds(const DerivativeScratch&, const JvpJob<Real>& job, Offset at, Index,
                                    ConeMode mode) {
  if (mode == ConeMode::at_lo) return given(job.tangents.lo, at);
  if (mode == ConeMode::at_hi) return given(job.tangents.hi, at);
  return 0.0;
}

/// Computes the change of every row's reaction by its cone's friction or bounds, while the unknowns rest, to `s.nu`.
/// Its effect on the tests of sliding cones goes to `s.image`.
template <Team TeamT, class Real, class Scratch>
STICTION_HD void change_bounds(TeamT& team, const EnvView<Real>& env, const JvpJob<Real>& job, const Scratch& s,
                               Offset set) {
  const Offset rows = set * job.batch.row_count + env.first_row;
  const Real* const lambda = job.at.lambda + env.first_row;
  for_each(team, env.cone_count, [&](Index cone) {
    const Index first = env.cone_row(cone), size = env.cone_size(cone);
    const auto mode = static_cast<ConeMode>(s.mode[cone]);
    for (Index k = 0; k < size; ++k) {
      const Index i = env.row_of(first, size, k);
      s.nu[i] = s.image[i] = 0.0;
      if (env.kind[cone] == ConeKind::box) s.nu[i] = change_by_bounds(s, job, rows + i, i, mode);
      if (env.kind[cone] != ConeKind::friction || mode != ConeMode::sliding || k == 0) continue;
      if (!(env.friction(i) > Real(0))) continue;
      const double share = div_(given(job.tangents.mu, rows + i), static_cast<double>(env.friction(i)));
      s.nu[i] = share * static_cast<double>(lambda[i]);
      s.image[i] = share * s.w[i];
    }
  });
}

/// The change of the solution by a set. Leaves d lambda in `s.nu` and dw in `s.seed`.
template <Team TeamT, class Real, class Scratch>
STICTION_HD SolutionCheck<double> solve_change(TeamT& team, const EnvView<Real>& env, const JvpJob<Real>& job,
                                               const Scratch& s, Offset set, Index unknowns) {
  const Offset rows = set * job.batch.row_count + env.first_row;
  const Real* const lambda = job.at.lambda + env.first_row;
  const EnvModes<Real> modes = modes_of(env, s);
  project_reactions(team, env, job, s, set);
  // Change of the motion by b, R and A while the reactions rest.
  const auto motion_change = [&](Index i) {
    const double by_b =
        fma_(given(job.tangents.R, rows + i), static_cast<double>(lambda[i]), given(job.tangents.b, rows + i));
    return by_b + row_change(env, job, s, i, set);
  };
  for_each(team, env.n, [&](Index i) { s.still[i] = motion_change(i); });
  change_bounds(team, env, job, s, set);
  const auto still = [&](Index i) { return s.still[i]; };
  const auto keep = [&](Index i, double value) { s.seed[i] = value; };
  apply_rows(team, modes, s.nu, still, keep);
  double largest = 0.0;
  const auto tested = [&](Index i) { return s.seed[i] + s.image[i]; };
  to_unknowns(team, modes, s.F, tested, [&](Index k, Index, double value) {
    s.unknown[k] = 0.0 - value;
    largest = max_(abs_(value * s.row_scale[k]), largest);
  });
  solve_system(team, DenseMatrix{s.K, unknowns}, s);
  for_each(team, env.n, [&](Index i) { s.nu[i] = s.nu[i] + from_unknowns(modes, s.E, i); });
  apply_rows(team, modes, s.nu, still, keep);
  double left = 0.0;
  to_unknowns(team, modes, s.F, tested, [&](Index k, Index slot, double value) {
    left = max_(abs_(fma_(s.D[slot], s.unknown[k], value) * s.row_scale[k]), left);
  });
  bool is_finite = true;
  for_each(team, env.n, [&](Index i) { is_finite = is_finite && finite_(s.nu[i]) && finite_(s.seed[i]); });
  return check_solution(team, left, largest, is_finite);
}

/// The changes of one set; zeros where `refused`.
template <Team TeamT, class Real>
STICTION_HD void write_changes(TeamT& team, const EnvView<Real>& env, const JvpJob<Real>& job,
                               const DerivativeScratch& s, Offset set, bool refused) {
  const Offset rows = set * job.batch.row_count + env.first_row;
  for_each(team, env.n, [&](Index i) {
    put(job.changes.lambda, rows + i, refused ? 0.0 : s.nu[i]);
    put(job.changes.w, rows + i, refused ? 0.0 : s.seed[i]);
  });
}

/// Pushes all sets of changes of one environment, whose directions are known, forward and writes its record.
template <Team TeamT, class Real, class Scratch>
STICTION_HD void jvp_along(TeamT& team, const EnvView<Real>& env, const JvpJob<Real>& job, Offset index,
                           const Scratch& s, ModesFound found) {
  if ((found.flags & kGradientRefused) == 0) found.flags |= factor_system<false>(team, env, s, found.unknowns);
  double residual = 0.0;
  const bool refused = (found.flags & kGradientRefused) != 0;
  for (Offset set = 0; set < job.count; ++set) {
    bool broken = refused;
    if (!refused) {
      const auto own = solve_change(team, env, job, s, set, found.unknowns);
      broken = !own.is_finite;
      if (broken) {
        found.flags |= kGradientNonFinite;
      } else {
        residual = max_(own.residual, residual);
      }
    }
    write_changes(team, env, job, s, set, broken);
  }
  write_record(team, job, index, found, residual);
}

/// Pushes all sets of changes of one environment forward and writes its record.
template <Team TeamT, class Real>
STICTION_HD void jvp_env(TeamT& team, const JvpJob<Real>& job, Offset index, double* memory) {
  const EnvView<Real> env = slice_problem(job.batch, job.law, index);
  const DerivativeScratch s = lay_out(job, index, memory);
  jvp_along(team, env, job, index, s, find_answer(team, env, job, index, s));
}

/// Zeros for an environment that was not looked at, and its record.
template <Team TeamT, class Real>
STICTION_HD void refuse_jvp(TeamT& team, const JvpJob<Real>& job, Offset index, std::uint32_t flags) {
  const EnvView<Real> env = slice_problem(job.batch, job.law, index);
  for (Offset set = 0; set < job.count; ++set) write_changes(team, env, job, DerivativeScratch{}, set, true);
  write_record(team, job, index, ModesFound{flags, 0.0, 0, 0}, 0.0);
}

}  // namespace stiction::inline STICTION_ISA
