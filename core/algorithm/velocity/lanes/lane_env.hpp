#pragma once

#include <cstdint>

#include "core/algorithm/jacobian/jacobian_batch.hpp"
#include "core/algorithm/problem/cone_shape.hpp"
#include "core/algorithm/velocity/lanes/dof_set.hpp"
#include "core/job/velocity_job.hpp"

/// One environment, or a part of one that nothing couples with the rest, as a lane of Newton's method in velocities
/// takes it.
namespace stiction::inline STICTION_ISA {

/// Most rows: a lane of a GPU keeps room for the largest environment.
inline constexpr Index kMostVelocityRows = 1024;
/// A coupled part of more than 64 degrees of freedom is large. Limits are on them, on entries of its factor
/// and of J, and on the lists of its tree.
inline constexpr Index kMostLargeDofs = SetTraits<LargeDofSet>::kMost;
inline constexpr Index kMostLargeEntries = 16384;
inline constexpr Index kMostLargeColumns = kMostVelocityRows * kMostVelocityDofs;
inline constexpr Index kMostLargePaths = 16384;

/// The environment's degree of freedom that is number k here, and back. A factor L L' ends with the last one, and the
/// factor here with number 0. A factor's are hence numbered backwards, and L has the tree's zeros.
template <class Real>
STICTION_HD Index dof_of(const LaneEnv<Real>& env, Index k) {
  if (env.dof != nullptr) return env.dof[k];
  return env.is_reversed ? env.dofs - 1 - k : k;
}
template <class Real>
STICTION_HD Index local_of(const LaneEnv<Real>& env, Index of_env) {
  if (env.local != nullptr) return env.local[of_env];
  return env.is_reversed ? env.dofs - 1 - of_env : of_env;
}
template <class Real>
STICTION_HD Index cone_of(const LaneEnv<Real>& env, Index i) {
  return env.cone == nullptr ? i : env.cone[i];
}
/// The first of the environment's that is in a part.
template <class Real>
STICTION_HD Index lowest_dof(const LaneEnv<Real>& env) {
  return dof_of(env, env.is_reversed ? env.dofs - 1 : 0);
}
/// Returns the entry of number 0 in the row of number k in M, where is_one_block.
template <class Real>
STICTION_HD Offset mass_row(const LaneEnv<Real>& env, Index k) {
  return static_cast<Offset>(dof_of(env, k)) * env.block + dof_of(env, 0) % env.block;
}
/// M, or its factor, between number k and one that is not after it.
template <class Real>
STICTION_HD Real mass_entry(const LaneEnv<Real>& env, Index k, Index before) {
  const Index a = dof_of(env, k), b = dof_of(env, before), row = a > b ? a : b, column = a > b ? b : a;
  return column / env.block == row / env.block ? env.M[static_cast<Offset>(row) * env.block + column % env.block]
                                               : Real(0);
}

/// Returns true if cones tile an environment's rows, each with as many as its kind has. Nothing in the arrays is
/// believed; rows are known to be sound.
template <class Real>
STICTION_HD bool cones_are_sound(const JacobianBatchView<Real>& batch, Offset env) {
  const Offset cones = used_part(batch.env_cone_offsets, batch.env_cone_counts, env, batch.cone_count);
  const Offset first = batch.env_row_offsets[env], end = first + batch.env_rows(env);
  Offset row = first;
  for (Offset cone = 0; cone < cones; ++cone) {
    const Offset at = batch.env_cone_offsets[env] + cone;
    const Offset rows = batch.cone_row_offsets[at + 1] - batch.cone_row_offsets[at];
    const ConeKind kind = batch.cone_kind[at];
    const bool fits =
        kind == ConeKind::friction ? rows >= 2 && rows <= kMaxConeRows : rows == 1 && static_cast<unsigned>(kind) < 3U;
    if (!fits || batch.cone_row_offsets[at] != row || row + rows > end) return false;
    row += rows;
  }
  return cones >= 0 && row == end;
}

/// Returns true if an environment is better solved so even if that takes a sequence of problems (Coulomb's law, rows
/// without compliance). With few rows beside the degrees of freedom, A is small and sweeps on it are faster. If rows
/// outnumber them, contacts are redundant, and sweeps are slow (docs/math/auto.md).
STICTION_HD bool pays_in_sequence(Index rows, Index dofs) {
  return 8 * rows > 9 * dofs;
}

/// Returns true if the method may take an environment, whatever its size. Its rows, J and M are known to be sound.
template <class Real>
STICTION_HD bool takes_form(const JacobianBatchView<Real>& batch, Offset env) {
  const bool is_whole =
      batch.env_flags == nullptr || (batch.env_flags[env] & ~static_cast<std::uint32_t>(kFlagContactsDropped)) == 0;
  return is_whole && cones_are_sound(batch, env);
}
/// Returns true if any cone has a normal row without compliance. Its proximal term makes a sequence of problems.
template <class Real>
STICTION_HD bool has_rigid_cone(const JacobianBatchView<Real>& batch, const LaneEnv<Real>& env) {
  for (Index i = 0; i < env.cones; ++i)
    if (batch.R[batch.cone_row_offsets[env.first_cone + cone_of(env, i)]] == Real(0)) return true;
  return false;
}
/// Returns true if it takes an environment, or a part of one, of that size. Others that take a sequence of problems
/// and do not pay are found when their numbers are known.
template <class Real>
STICTION_HD bool takes_size(const JacobianBatchView<Real>& batch, const LaneEnv<Real>& env, Law law) {
  if (env.dofs <= 0 || env.dofs > kMostLargeDofs || env.rows < 0 || env.rows > kMostVelocityRows) return false;
  return env.rows == 0 || pays_in_sequence(env.rows, env.dofs) || (law == Law::convex && !has_rigid_cone(batch, env));
}

/// True if single precision is tried on environments that steps in double leave unsolved. An answer may be none once
/// it is rounded, while one that such steps end at is rounded all along. Parts are not: one answer is of all.
template <class Real>
STICTION_HD bool is_tried_again(const LaneEnv<Real>& env) {
  return env.dof == nullptr && env.dofs <= kMostVelocityDofs;
}

template <class Real>
STICTION_HD LaneEnv<Real> lane_env(const JacobianBatchView<Real>& batch, Offset env) {
  LaneEnv<Real> e;
  e.env = env;
  e.rows = batch.env_rows(env);
  e.dofs = batch.env_dofs(env);
  e.cones = batch.env_cones(env);
  e.block = batch.mass_block == 0 ? e.dofs : batch.mass_block;
  e.first_row = batch.env_row_offsets[env];
  e.first_cone = batch.env_cone_offsets[env];
  e.M = batch.M + batch.env_mass_offsets[env];
  e.v_free = batch.v_free + batch.env_dof_offsets[env];
  e.is_one_block = e.block == e.dofs;
  e.is_reversed = batch.mass_form == MassForm::factor;
  return e;
}

/// Up to that many degrees of freedom are taken for coupled all with all. It is faster to multiply with zeros than to
/// look for them, and more cones lie side by side. It saves 17 % of the time of the recorded car's 8, but Go1's 18
/// would take 70 % more.
inline constexpr Index kDenseDofs = 9;

/// Degrees of freedom that a row of J touches, by its stored numbers.
template <class Set, class Real>
STICTION_HD Set row_dofs(const JacobianBatchView<Real>& batch, const LaneEnv<Real>& env, Index row) {
  if (env.dofs <= kDenseDofs) return below<Set>(env.dofs);
  const Offset begin = batch.row_offsets[env.first_row + row];
  if (batch.column == nullptr && env.is_consecutive) {
    const Set set = nonzero_set<Set>(batch.J + begin + lowest_dof(env), env.dofs, 0);
    return env.is_reversed ? mirrored(set, env.dofs) : set;
  }
  Set set{};
  if (batch.column == nullptr) {
    for (Index k = 0; k < env.dofs; ++k)
      if (batch.J[begin + dof_of(env, k)] != Real(0)) set |= only<Set>(k);
    return set;
  }
  const Offset end = batch.row_offsets[env.first_row + row + 1];
  for (Offset k = begin; k < end; ++k)
    if (batch.J[k] != Real(0)) set |= only<Set>(local_of(env, batch.column[k]));
  return set;
}

/// Reads the row of M, or of its factor, of number `dof`: entries that are not zero, but for the diagonal. Bit i is
/// the i-th in the environment's order, of a part's degrees of freedom that follow one another.
template <class Set, class Real>
STICTION_HD Set mass_row_set(const LaneEnv<Real>& env, Index dof) {
  const Index base = lowest_dof(env), row = dof_of(env, dof), block = row - row % env.block;
  const Index first = block > base ? block : base;
  const Real* const entries = env.M + static_cast<Offset>(row) * env.block + (first - block);
  return nonzero_set<Set>(entries, row - first, first - base);
}

/// coupled[k] |= numbers before k that M couples it with. A factor couples those that are in one of its columns, as
/// the tree does from entries between number k and others.
template <class Set, Team TeamT, class Real>
STICTION_HD void add_mass_dofs(TeamT& team, const LaneEnv<Real>& env, Set* coupled) {
  if (env.dofs > kDenseDofs && env.is_consecutive && env.is_reversed) {
    single(team, [&] {  // a row is in the sets of several
      for (Index k = 0; k < env.dofs; ++k)
        for_each_dof(mass_row_set<Set>(env, k), [&](Index i) { coupled[env.dofs - 1 - i] |= only<Set>(k); });
    });
    return;
  }
  for_each(team, env.dofs, [&](Index k) {
    if (env.dofs <= kDenseDofs) {
      coupled[k] |= below<Set>(k);
    } else if (env.is_consecutive) {
      coupled[k] |= mass_row_set<Set>(env, k);
    } else {
      for (Index before = 0; before < k; ++before)
        if (mass_entry(env, k, before) != Real(0)) coupled[k] |= only<Set>(before);
    }
  });
}

}  // namespace stiction::inline STICTION_ISA
