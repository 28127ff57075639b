#pragma once

#include "core/algorithm/derivative/vjp.hpp"
#include "core/algorithm/jacobian/delassus.hpp"

/// From cotangents of velocities to those of reactions, and from the cotangent nu of b to those of J, M and v_free.
/// Both go through the adjoint velocity a = M^-1 (v_bar + J' nu) (docs/math/derivative.md, (13) to (17)), in the
/// precision in which A is assembled.
namespace stiction::inline STICTION_ISA {

template <class Real>
using ChainTile = RowTile<Real>;

/// Scratch of one environment, in numbers of Real.
template <class Real>
STICTION_HD Offset chain_elements(const JacobianVjpJob<Real>& job, Offset env) {
  return jacobian_elements<ChainTile<Real>>(job.batch, env) + 5 * static_cast<Offset>(job.batch.env_dofs(env));
}

/// One environment and its vectors.
template <class Real>
struct ChainEnv : JacobianEnv<ChainTile<Real>> {
  Offset first_dof;
  Real* moved;      ///< M^-1 J' lambda                                  (dofs)
  Real* motion;     ///< v_bar + J' nu, then scratch                     (dofs)
  Real* adjoint;    ///< the adjoint velocity                            (dofs)
  Real* moved_L;    ///< L' moved, of a factor that came as M            (dofs)
  Real* adjoint_L;  ///< L' adjoint                                      (dofs)

  STICTION_HD ChainEnv(const JacobianVjpJob<Real>& job, Offset env, Real* scratch)
      : JacobianEnv<ChainTile<Real>>(
            slice<ChainTile<Real>>(job.batch, env, scratch + 5 * Offset{job.batch.env_dofs(env)})),
        first_dof(job.batch.env_dof_offsets[env]),
        moved(scratch),
        motion(moved + this->dofs),
        adjoint(motion + this->dofs),
        moved_L(adjoint + this->dofs),
        adjoint_L(moved_L + this->dofs) {}
};

/// What the loss says of the reactions: lambda_bar + J M^-1 v_bar.
template <Team TeamT, class Real>
STICTION_HD void seed_env(TeamT& team, const JacobianVjpJob<Real>& job, Offset index, Real* scratch) {
  const ChainEnv<Real> env(job, index, scratch);
  const Real* const v_bar = job.cotangents.velocity;
  const bool moves = v_bar != nullptr && env.n > 0 && factor_mass(team, env.L, env.M, job.batch.mass_form);
  for (Offset set = 0; set < job.count; ++set) {
    const Offset rows = set * job.batch.row_count + env.first_row;
    if (moves) {
      const Offset dofs = set * job.batch.dof_count + env.first_dof;
      for_each(team, env.dofs, [&](Index k) { env.motion[k] = v_bar[dofs + k]; });
      solve_mass(team, env.L, env.motion, env.adjoint);
    }
    for_each(team, env.n, [&](Index i) {
      Real sum = job.cotangents.lambda == nullptr ? Real(0) : job.cotangents.lambda[rows + i];
      if (moves) env.for_each_entry(i, [&](Index k, Real value) { sum = fma_(value, env.adjoint[k], sum); });
      job.seed[rows + i] = sum;
    });
  }
}

/// L' x of every block, L being a factor that came as M.
template <Team TeamT, class Real>
STICTION_HD void multiply_factor(TeamT& team, const ChainEnv<Real>& env, const Real* x, Real* out) {
  const Index block = env.L.block;
  for_each(team, env.dofs, [&](Index j) {
    const Index end = (j / block + 1) * block;
    Real sum(0);
    for (Index i = j; i < end; ++i) sum = fma_(env.M[static_cast<Offset>(i) * block + j % block], x[i], sum);
    out[j] = sum;
  });
}

/// A cotangent as it is stored.
template <class Real>
STICTION_HD void put_chain(Real* to, Offset at, Real value, bool refused) {
  if (to != nullptr) put(to, at, refused ? 0.0 : static_cast<double>(value));
}

/// Cotangents of M: -(a p' + p a') / 2 with p = M^-1 J' lambda, and of a factor L: -(a (L'p)' + p (L'a)').
template <Team TeamT, class Real>
STICTION_HD void write_mass_gradient(TeamT& team, const ChainEnv<Real>& env, const JacobianVjpJob<Real>& job,
                                     Offset index, Offset set, bool refused) {
  if (job.gradients.M == nullptr) return;
  const bool is_factor = job.batch.mass_form == MassForm::factor;
  if (is_factor) {
    multiply_factor(team, env, env.moved, env.moved_L);
    multiply_factor(team, env, env.adjoint, env.adjoint_L);
  }
  const Index block = env.L.block;
  const Offset first = set * job.batch.mass_count + job.batch.env_mass_offsets[index];
  for_each(team, env.dofs, [&](Index i) {
    const Index begin = i / block * block;
    for (Index c = 0; c < block; ++c) {
      const Index j = begin + c;
      const Real one = is_factor ? env.moved_L[j] : env.moved[j];
      const Real two = is_factor ? env.adjoint_L[j] : env.adjoint[j];
      const Real sum = fma_(env.adjoint[i], one, env.moved[i] * two);
      const Real value = is_factor ? (j > i ? Real(0) : sum) : Real(0.5) * sum;
      put_chain(job.gradients.M, first + static_cast<Offset>(i) * block + c, Real(0) - value, refused);
    }
  });
}

/// Cotangents of one set; zeros where `refused`.
template <Team TeamT, class Real>
STICTION_HD void write_chain(TeamT& team, const ChainEnv<Real>& env, const JacobianVjpJob<Real>& job, Offset index,
                             Offset set, bool refused) {
  const JacobianBatchCotangentView<Real>& to = job.gradients;
  const Offset rows = set * job.batch.row_count + env.first_row;
  const Offset entries = set * job.batch.entry_count;
  const Real* const lambda = job.at.lambda + env.first_row;
  for_each(team, env.n, [&](Index i) {
    const Real nu = job.nu[rows + i];
    put_chain(to.target, rows + i, Real(0) - nu, refused);
    if (refused) {
      put_chain(to.R, rows + i, Real(0), true);
      put_chain(to.mu, rows + i, Real(0), true);
      put_chain(to.lo, rows + i, Real(0), true);
      put_chain(to.hi, rows + i, Real(0), true);
    }
    if (to.J == nullptr) return;
    Offset at = entries + job.batch.row_offsets[env.first_row + i];
    env.for_each_entry(i, [&](Index k, Real) {
      const Real velocity = env.v_free[k] + env.moved[k];
      put_chain(to.J, at, fma_(nu, velocity, lambda[i] * env.adjoint[k]), refused);
      ++at;
    });
  });
  write_mass_gradient(team, env, job, index, set, refused);
}

/// Cotangents of J, M, v_free and target of one environment, from that of b.
template <Team TeamT, class Real>
STICTION_HD void chain_env(TeamT& team, const JacobianVjpJob<Real>& job, Offset index, Real* scratch) {
  const ChainEnv<Real> env(job, index, scratch);
  const bool is_mass = factor_mass(team, env.L, env.M, job.batch.mass_form);
  const bool refused = !is_mass || (job.status[index].flags & kGradientRefused) != 0;
  if (!refused) {
    pull_reactions(team, env, job.at.lambda + env.first_row, env.motion);
    solve_mass(team, env.L, env.motion, env.moved);
  }
  std::uint32_t flags = is_mass ? 0U : static_cast<std::uint32_t>(kGradientInvalidInput);
  for (Offset set = 0; set < job.count; ++set) {
    const Offset dofs = set * job.batch.dof_count + env.first_dof;
    std::uint32_t broken = refused ? 1U : 0U;
    if (!refused) {
      pull_reactions(team, env, job.nu + set * job.batch.row_count + env.first_row, env.motion);
      for_each(team, env.dofs, [&](Index k) {
        if (job.cotangents.velocity != nullptr) env.motion[k] = job.cotangents.velocity[dofs + k] + env.motion[k];
        if (!finite_(env.motion[k])) broken = 1;
        put_chain(job.gradients.v_free, dofs + k, env.motion[k], false);
      });
      solve_mass(team, env.L, env.motion, env.adjoint);
      for_each(team, env.dofs, [&](Index k) {
        if (!finite_(env.adjoint[k]) || !finite_(env.moved[k])) broken = 1;
      });
      broken = team.combine(broken);
      if (broken != 0) flags |= kGradientNonFinite;
    }
    if (broken != 0) {
      for_each(team, env.dofs, [&](Index k) { put_chain(job.gradients.v_free, dofs + k, Real(0), true); });
    }
    write_chain(team, env, job, index, set, broken != 0);
  }
  single(team, [&] { job.status[index].flags |= flags; });
}

}  // namespace stiction::inline STICTION_ISA
