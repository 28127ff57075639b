#pragma once

#include "core/algorithm/derivative/vjp.hpp"

/// Changes of an environment's numbers pushed forward to its solution (docs/math/derivative.md, (7) and (8)).
namespace stiction::inline STICTION_ISA {

/// Rows of dA, which stores what A stores.
template <class Real>
struct ChangedRows {
  const EnvView<Real>& env;
  const Real* dA;

  [[nodiscard]] STICTION_HD Index rows() const { return env.n; }
  [[nodiscard]] STICTION_HD StoredRow<Real> row(Index i) const {
    return {dA + env.row_offsets[i], env.columns(i), env.entries(i)};
  }
};

/// dA lambda of a row of A = Y Y': dY (Y' lambda) + Y (dY' lambda).
template <class Real>
STICTION_HD double change_by_factor(const EnvView<Real>& env, const JvpJob<Real>& job, const DerivativeScratch& s,
                                    Index row, Offset set) {
  double sum = 0.0;
  if (env.factor == nullptr || job.tangents.factor == nullptr) return sum;
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

/// Computes the change of every row's motion by b, R and A while the reactions rest, to `s.still`.
template <Team TeamT, class Real>
STICTION_HD void change_motion_at_rest(TeamT& team, const EnvView<Real>& env, const JvpJob<Real>& job,
                                       const DerivativeScratch& s, Offset set) {
  const Offset rows = set * job.batch.row_count + env.first_row;
  const Real* const lambda = job.at.lambda + env.first_row;
  project_reactions(team, env, job, s, set);
  const auto keep = [&](Index i, double by_A) {
    const double by_b =
        fma_(given(job.tangents.R, rows + i), static_cast<double>(lambda[i]), given(job.tangents.b, rows + i));
    s.still[i] = by_b + by_A;
  };
  if (env.factor == nullptr && job.tangents.A != nullptr) {
    const ChangedRows<Real> changed{env, job.tangents.A + set * job.batch.nonzero_count};
    return sum_rows(team, changed, lambda, [](Index) { return 0.0; }, keep);
  }
  for_each(team, env.n, [&](Index i) { keep(i, change_by_factor(env, job, s, i, set)); });
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

/// The change of the solution by a set, of one environment or of environments side by side. `still`, `nu` and `image`
/// have the changes of motions, reactions and tests while the unknowns rest. Leaves d lambda in `nu` and dw in `seed`.
/// `K`: the factor of G.
template <Team TeamT, class Modes, class Matrix>
STICTION_HD auto solve_change(TeamT& team, const Modes& modes, const Matrix& K) {
  using Wide = typename Modes::Wide;
  const auto& s = modes.s;
  const auto still = [&](Index i) { return s.still[i]; };
  const auto keep = [&](Index i, Wide value) { s.seed[i] = value; };
  apply_rows(team, modes, s.nu, still, keep);
  Wide largest(0);
  const auto tested = [&](Index i) { return s.seed[i] + s.image[i]; };
  to_unknowns(team, modes, s.F, tested, [&](Index k, Index, Wide value) {
    s.unknown[k] = Wide(0) - value;
    largest = max_(abs_(value * s.row_scale[k]), largest);
  });
  solve_system(team, K, s);
  for_each(team, modes.rows(), [&](Index i) { s.nu[i] = s.nu[i] + from_unknowns(modes, s.E, i); });
  apply_rows(team, modes, s.nu, still, keep);
  Wide left(0);
  to_unknowns(team, modes, s.F, tested, [&](Index k, Index slot, Wide value) {
    left = max_(abs_(fma_(s.D[slot], s.unknown[k], value) * s.row_scale[k]), left);
  });
  auto is_finite = finite_(Wide(0));
  for_each(team, modes.rows(),
           [&](Index i) { is_finite = and_(is_finite, and_(finite_(s.nu[i]), finite_(s.seed[i]))); });
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
      change_motion_at_rest(team, env, job, s, set);
      change_bounds(team, env, job, s, set);
      const auto own = solve_change(team, modes_of(env, s), DenseMatrix{s.K, found.unknowns});
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
