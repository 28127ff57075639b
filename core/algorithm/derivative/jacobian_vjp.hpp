#pragma once

#include "core/algorithm/derivative/jacobian_env.hpp"
#include "core/algorithm/derivative/vjp.hpp"

/// From cotangents of velocities to those of reactions, and from the cotangent nu of b to those of J, M and v_free.
/// Both go through the adjoint velocity a = M^-1 (v_bar + J' nu) (docs/math/derivative.md, (13) to (17)), in the
/// precision in which A is assembled.
namespace stiction::inline STICTION_ISA {

/// Computes the loss's derivative by the reactions: lambda_bar + J M^-1 v_bar. Without L nothing is read of it.
template <Team TeamT, class Tile>
STICTION_HD void seed_env(TeamT& team, const JacobianVjpJob<typename Tile::Real>& job, const ChainEnv<Tile>& env) {
  using Real = typename Tile::Real;
  const Real* const v_bar = job.cotangents.velocity;
  const bool moves = v_bar != nullptr && env.n > 0;
  for (Offset set = 0; set < job.contact.count; ++set) {
    const Offset rows = set * env.batch->row_count + env.first_row;
    if (moves) {
      const Offset dofs = set * env.batch->dof_count + env.first_dof;
      for_each(team, env.dofs, [&](Index k) { env.motion[k] = v_bar[dofs + k]; });
      solve_mass(team, env.L, env.motion, env.change);
    }
    for_each(team, env.n, [&](Index i) {
      Real sum = job.cotangents.lambda == nullptr ? Real(0) : job.cotangents.lambda[rows + i];
      if (moves) env.for_each_entry(i, [&](Index k, Real value) { sum = fma_(value, env.change[k], sum); });
      job.seed[rows + i] = sum;
    });
  }
}

/// A cotangent as it is stored.
template <class Real>
STICTION_HD void put_chain(Real* to, Offset at, Real value, bool refused) {
  if (to != nullptr) to[at] = refused ? Real(0) : stored(value);
}

/// Cotangents of M: -(a p' + p a') / 2 with p = M^-1 J' lambda, and of a factor L: -(a (L'p)' + p (L'a)').
template <Team TeamT, class Tile>
STICTION_HD void write_mass_gradient(TeamT& team, const ChainEnv<Tile>& env,
                                     const JacobianVjpJob<typename Tile::Real>& job, Offset index, Offset set,
                                     bool refused) {
  using Real = typename Tile::Real;
  if (job.gradients.M == nullptr) return;
  const bool is_factor = env.has_factor();
  if (is_factor && !refused) {
    multiply_factor(team, env, env.M, env.moved, env.moved_L);
    multiply_factor(team, env, env.M, env.change, env.change_L);
  }
  const Index block = env.L.block;
  const Offset first = set * env.batch->mass_count + env.batch->env_mass_offsets[index];
  for_each(team, env.dofs, [&](Index i) {
    const Index begin = i / block * block;
    Real* const row = job.gradients.M + first + static_cast<Offset>(i) * block;
    if (refused) {
      for (Index c = 0; c < block; ++c) row[c] = Real(0);
      return;
    }
    // A factor has nothing above its diagonal, and M both halves, of which each counts half.
    const Real* const moved = (is_factor ? env.moved_L : env.moved) + begin;
    const Real* const change = (is_factor ? env.change_L : env.change) + begin;
    const Index columns = is_factor ? i - begin + 1 : block;
    const Real one = env.change[i], two = env.moved[i], share = is_factor ? Real(1) : Real(0.5);
    for (Index c = 0; c < columns; ++c) row[c] = stored(Real(0) - share * fma_(one, moved[c], two * change[c]));
    for (Index c = columns; c < block; ++c) row[c] = Real(0);
  });
}

/// Cotangents of one set; zeros where `refused`, and then no scratch is read.
template <Team TeamT, class Tile>
STICTION_HD void write_chain(TeamT& team, const ChainEnv<Tile>& env, const JacobianVjpJob<typename Tile::Real>& job,
                             Offset index, Offset set, bool refused) {
  using Real = typename Tile::Real;
  const JacobianBatchCotangentView<Real>& to = job.gradients;
  const Offset rows = set * env.batch->row_count + env.first_row;
  const Offset entries = set * env.batch->entry_count;
  const Real* const lambda = job.contact.at.lambda + env.first_row;
  for_each(team, env.n, [&](Index i) {
    const Real nu = refused ? Real(0) : job.nu[rows + i];
    put_chain(to.target, rows + i, Real(0) - nu, refused);
    if (refused) {
      put_chain(to.R, rows + i, Real(0), true);
      put_chain(to.mu, rows + i, Real(0), true);
      put_chain(to.lo, rows + i, Real(0), true);
      put_chain(to.hi, rows + i, Real(0), true);
    }
    if (to.J == nullptr) return;
    Real* const row = to.J + entries + env.batch->row_offsets[env.first_row + i];
    const Real x = refused ? Real(0) : lambda[i];
    Index at = 0;
    if (refused)
      env.for_each_entry(i, [&](Index, Real) { row[at++] = Real(0); });
    else
      env.for_each_entry(
          i, [&](Index k, Real) { row[at++] = stored(fma_(nu, env.v_free[k] + env.moved[k], x * env.change[k])); });
  });
  write_mass_gradient(team, env, job, index, set, refused);
  if (refused)
    for_each(team, env.dofs,
             [&](Index k) { put_chain(to.v_free, set * env.batch->dof_count + env.first_dof + k, Real(0), true); });
}

/// Cotangents of J, M, v_free and target of one environment that is not refused, from that of b.
template <Team TeamT, class Tile>
STICTION_HD void chain_env(TeamT& team, const JacobianVjpJob<typename Tile::Real>& job, const ChainEnv<Tile>& env,
                           Offset index) {
  using Real = typename Tile::Real;
  const Real* const v_bar = job.cotangents.velocity;
  move_by_reactions(team, env, job.contact.at.lambda + env.first_row);
  std::uint32_t flags = 0;
  for (Offset set = 0; set < job.contact.count; ++set) {
    const Offset dofs = set * env.batch->dof_count + env.first_dof;
    std::uint32_t broken = 0;
    pull_reactions(team, env, job.nu + set * env.batch->row_count + env.first_row, env.motion);
    for_each(team, env.dofs, [&](Index k) {
      if (v_bar != nullptr) env.motion[k] = v_bar[dofs + k] + env.motion[k];
      if (!finite_(env.motion[k])) broken = 1;
      put_chain(job.gradients.v_free, dofs + k, env.motion[k], false);
    });
    solve_mass(team, env.L, env.motion, env.change);
    for_each(team, env.dofs, [&](Index k) {
      if (!finite_(env.change[k]) || !finite_(env.moved[k])) broken = 1;
    });
    broken = team.combine(broken);
    if (broken != 0) flags |= kGradientNonFinite;
    write_chain(team, env, job, index, set, broken != 0);
  }
  single(team, [&] { job.contact.status[index].flags |= flags; });
}

/// Runs before the derivative of the contact batch. Returns true if the environment's L is there, on every lane.
template <class Tile, Team TeamT>
STICTION_HD_OUTLINE bool begin_jacobian_vjp(TeamT& team, const JacobianVjpJob<typename Tile::Real>& job, Offset index,
                                            typename Tile::Real* own) {
  const bool is_mass = assemble_for_derivative<Tile>(team, job.assembly, index, own);
  if (is_mass) seed_env(team, job, ChainEnv<Tile>(job.assembly.batch, index, own));
  return is_mass;
}

/// Runs after the derivative of the contact batch. All zeros without L; of the scratch nothing is read then.
template <class Tile, Team TeamT>
STICTION_HD_OUTLINE void end_jacobian_vjp(TeamT& team, const JacobianVjpJob<typename Tile::Real>& job, Offset index,
                                          typename Tile::Real* own, bool is_mass) {
  const ChainEnv<Tile> env(job.assembly.batch, index, own);
  if (is_mass && (job.contact.status[index].flags & kGradientRefused) == 0) {
    chain_env(team, job, env, index);
  } else {
    for (Offset set = 0; set < job.contact.count; ++set) write_chain(team, env, job, index, set, true);
  }
}

/// Cotangents of J, M and target of an environment whose adjoint velocities lanes have found (jacobian_pack.hpp).
template <class Tile, Team TeamT>
STICTION_HD_OUTLINE void finish_answered(TeamT& team, const JacobianVjpJob<typename Tile::Real>& job, Offset index,
                                         typename Tile::Real* own) {
  ChainEnv<Tile> env(job.assembly.batch, index, own);
  env.moved = job.lanes.moved + env.first_dof;
  for (Offset set = 0; set < job.contact.count; ++set) {
    env.change = job.lanes.adjoint + set * env.batch->dof_count + env.first_dof;
    write_chain(team, env, job, index, set, false);
  }
}

/// Pulls all sets of cotangents of one environment back, to J and M where there are such, and writes its record.
template <class Tile, Team TeamT>
STICTION_HD void jacobian_vjp_env(TeamT& team, const JacobianVjpJob<typename Tile::Real>& job, Offset index,
                                  double* memory) {
  if (job.is_answered(index)) {
    finish_answered<Tile>(team, job, index, reinterpret_cast<typename Tile::Real*>(memory));
    return;
  }
  auto* const own = reinterpret_cast<typename Tile::Real*>(memory + derivative_elements(job.contact, index));
  const bool is_mass = job.has_jacobian && begin_jacobian_vjp<Tile>(team, job, index, own);
  vjp_env(team, job.contact, index, memory);
  if (job.has_jacobian) end_jacobian_vjp<Tile>(team, job, index, own, is_mass);
}

/// Zeros for an environment that was not looked at, and its record.
template <class Tile, Team TeamT>
STICTION_HD void refuse_jacobian_vjp(TeamT& team, const JacobianVjpJob<typename Tile::Real>& job, Offset index,
                                     std::uint32_t flags, double* memory) {
  refuse_vjp(team, job.contact, index, flags);
  if (job.has_jacobian) end_jacobian_vjp<Tile>(team, job, index, reinterpret_cast<typename Tile::Real*>(memory), false);
}

}  // namespace stiction::inline STICTION_ISA
