#pragma once

#include "core/algorithm/derivative/jacobian_env.hpp"
#include "core/algorithm/derivative/jvp.hpp"

/// Changes of J, M and v_free pushed forward to reactions, motion and velocities (docs/math/derivative.md, (19) to
/// (21)), in the precision in which A is assembled.
namespace stiction::inline STICTION_ISA {

/// Takes dM p of every block from the motion. Only the symmetric part of dM counts; with M = L L' it is dL L' + L dL'.
template <Team TeamT, class Tile>
STICTION_HD void take_mass_change(TeamT& team, const ChainEnv<Tile>& env, const typename Tile::Real* dM) {
  using Real = typename Tile::Real;
  const Index block = env.L.block;
  if (env.has_factor()) {
    multiply_factor(team, env, env.M, env.moved, env.moved_L);
    multiply_factor(team, env, dM, env.moved, env.change_L);
  }
  for_each(team, env.dofs, [&](Index i) {
    const Index begin = i / block * block;
    const auto entry = [&](Index row, Index column) { return static_cast<Offset>(row) * block + column - begin; };
    Real sum(0);
    if (env.has_factor()) {
      for (Index j = begin; j <= i; ++j) {
        sum = fma_(dM[entry(i, j)], env.moved_L[j], sum);
        sum = fma_(env.M[entry(i, j)], env.change_L[j], sum);
      }
    } else {
      for (Index j = begin; j < begin + block; ++j)
        sum = fma_(Real(0.5) * (dM[entry(i, j)] + dM[entry(j, i)]), env.moved[j], sum);
    }
    env.motion[i] = env.motion[i] - sum;
  });
}

/// Adds the change of M v+ by J and M while the reactions rest, to `motion`: dJ' lambda - dM p.
template <Team TeamT, class Tile>
STICTION_HD void change_momentum(TeamT& team, const ChainEnv<Tile>& env, const JacobianJvpJob<typename Tile::Real>& job,
                                 Offset index, Offset set) {
  using Real = typename Tile::Real;
  if (job.tangents.J != nullptr) {
    JacobianBatchView<Real> changed = *env.batch;
    changed.J = job.tangents.J + set * changed.entry_count;
    JacobianEnv<Tile> own = env;
    own.batch = &changed;
    pull_reactions(team, own, job.contact.at.lambda + env.first_row, env.motion);
  } else {
    for_each(team, env.dofs, [&](Index k) { env.motion[k] = 0; });
  }
  if (job.tangents.M != nullptr)
    take_mass_change(team, env, job.tangents.M + set * env.batch->mass_count + env.batch->env_mass_offsets[index]);
}

template <class Tile>
STICTION_HD typename Tile::Real change_of_free_velocity(const ChainEnv<Tile>& env,
                                                        const JacobianJvpJob<typename Tile::Real>& job, Offset set,
                                                        Index k) {
  using Real = typename Tile::Real;
  if (job.tangents.v_free == nullptr) return Real(0);
  return job.tangents.v_free[set * env.batch->dof_count + env.first_dof + k];
}

/// Change of every row's motion while the reactions rest: dJ v+ + J (dv_free + M^-1 (dJ' lambda - dM p)) - dtarget.
template <Team TeamT, class Tile>
STICTION_HD void change_motion(TeamT& team, const ChainEnv<Tile>& env, const JacobianJvpJob<typename Tile::Real>& job,
                               Offset index) {
  using Real = typename Tile::Real;
  move_by_reactions(team, env, job.contact.at.lambda + env.first_row);
  for (Offset set = 0; set < job.contact.count; ++set) {
    change_momentum(team, env, job, index, set);
    solve_mass(team, env.L, env.motion, env.change);
    const Offset rows = set * env.batch->row_count + env.first_row;
    for_each(team, env.n, [&](Index i) {
      Real sum = job.tangents.target == nullptr ? Real(0) : Real(0) - job.tangents.target[rows + i];
      env.for_each_entry(i, [&](Index k, Real value) {
        sum = fma_(value, change_of_free_velocity(env, job, set, k) + env.change[k], sum);
      });
      if (job.tangents.J != nullptr) {
        const Real* changed = job.tangents.J + set * env.batch->entry_count + env.batch->row_offsets[env.first_row + i];
        env.for_each_entry(i, [&](Index k, Real) {
          sum = fma_(*changed, env.v_free[k] + env.moved[k], sum);
          ++changed;
        });
      }
      job.motion[rows + i] = sum;
    });
  }
}

/// Changes of velocities of one set; zeros where `refused`, and then no scratch is read.
template <Team TeamT, class Tile>
STICTION_HD void write_velocity_change(TeamT& team, const ChainEnv<Tile>& env,
                                       const JacobianJvpJob<typename Tile::Real>& job, Offset set, bool refused) {
  using Real = typename Tile::Real;
  if (job.changes.velocity == nullptr) return;
  for_each(team, env.dofs, [&](Index k) {
    Real value(0);
    if (!refused) value = change_of_free_velocity(env, job, set, k) + env.change[k];
    put(job.changes.velocity, set * env.batch->dof_count + env.first_dof + k, static_cast<double>(value));
  });
}

/// A set of which nothing is known: zeros.
template <Team TeamT, class Tile>
STICTION_HD void refuse_change(TeamT& team, const ChainEnv<Tile>& env, const JacobianJvpJob<typename Tile::Real>& job,
                               Offset set) {
  write_velocity_change(team, env, job, set, true);
  const Offset rows = set * env.batch->row_count + env.first_row;
  for_each(team, env.n, [&](Index i) {
    put(job.changes.lambda, rows + i, 0.0);
    put(job.changes.w, rows + i, 0.0);
  });
}

/// Changes of velocities of an environment that is not refused: dv_free + M^-1 (dJ' lambda - dM p + J' dlambda).
template <Team TeamT, class Tile>
STICTION_HD void change_velocities(TeamT& team, const ChainEnv<Tile>& env,
                                   const JacobianJvpJob<typename Tile::Real>& job, Offset index) {
  std::uint32_t flags = 0;
  for (Offset set = 0; set < job.contact.count; ++set) {
    const Offset rows = set * env.batch->row_count + env.first_row;
    change_momentum(team, env, job, index, set);
    pull_reactions(team, env, job.reaction + rows, env.change_L);
    for_each(team, env.dofs, [&](Index k) { env.motion[k] = env.motion[k] + env.change_L[k]; });
    solve_mass(team, env.L, env.motion, env.change);
    std::uint32_t broken = 0;
    for_each(team, env.dofs, [&](Index k) {
      if (!finite_(env.change[k]) || !finite_(change_of_free_velocity(env, job, set, k))) broken = 1;
    });
    broken = team.combine(broken);
    if (broken != 0) {
      flags |= kGradientNonFinite;
      refuse_change(team, env, job, set);
      continue;
    }
    write_velocity_change(team, env, job, set, false);
    if (job.changes.lambda == nullptr) continue;
    for_each(team, env.n, [&](Index i) { job.changes.lambda[rows + i] = job.reaction[rows + i]; });
  }
  single(team, [&] { job.contact.status[index].flags |= flags; });
}

/// Runs before the derivative of the contact batch. Returns true if the environment's L is there, on every lane.
template <class Tile, Team TeamT>
STICTION_HD_OUTLINE bool begin_jacobian_jvp(TeamT& team, const JacobianJvpJob<typename Tile::Real>& job, Offset index,
                                            typename Tile::Real* own) {
  const bool is_mass = assemble_for_derivative<Tile>(team, job.assembly, index, own);
  if (is_mass) change_motion(team, ChainEnv<Tile>(job.assembly.batch, index, own), job, index);
  return is_mass;
}

/// Runs after the derivative of the contact batch. All zeros without L; of the scratch nothing is read then.
template <class Tile, Team TeamT>
STICTION_HD_OUTLINE void end_jacobian_jvp(TeamT& team, const JacobianJvpJob<typename Tile::Real>& job, Offset index,
                                          typename Tile::Real* own, bool is_mass) {
  const ChainEnv<Tile> env(job.assembly.batch, index, own);
  if (is_mass && (job.contact.status[index].flags & kGradientRefused) == 0) {
    change_velocities(team, env, job, index);
  } else {
    for (Offset set = 0; set < job.contact.count; ++set) refuse_change(team, env, job, set);
  }
}

/// Pushes all sets of changes of one environment forward, of J and M where there are such, and writes its record.
template <class Tile, Team TeamT>
STICTION_HD void jacobian_jvp_env(TeamT& team, const JacobianJvpJob<typename Tile::Real>& job, Offset index,
                                  double* memory) {
  auto* const own = reinterpret_cast<typename Tile::Real*>(memory + derivative_elements(job.contact, index));
  const bool is_mass = job.has_jacobian && begin_jacobian_jvp<Tile>(team, job, index, own);
  jvp_env(team, job.contact, index, memory);
  if (job.has_jacobian) end_jacobian_jvp<Tile>(team, job, index, own, is_mass);
}

/// Zeros for an environment that was not looked at, and its record.
template <class Tile, Team TeamT>
STICTION_HD void refuse_jacobian_jvp(TeamT& team, const JacobianJvpJob<typename Tile::Real>& job, Offset index,
                                     std::uint32_t flags, double* memory) {
  refuse_jvp(team, job.contact, index, flags);
  if (job.has_jacobian) end_jacobian_jvp<Tile>(team, job, index, reinterpret_cast<typename Tile::Real*>(memory), false);
}

}  // namespace stiction::inline STICTION_ISA
