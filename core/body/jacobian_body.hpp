#pragma once

#include "core/base/jacobian_job.hpp"
#include "core/block/reduce.hpp"

/// From J, M and v_free to A and b, and from reactions to velocities (docs/jacobian.md).
namespace stiction::inline STICTION_ISA {

/// A block-diagonal lower triangular matrix, the blocks dense and row-major: one block makes it dense, blocks of one
/// row make it a diagonal.
template <class Real>
struct BlockTriangle {
  Real* data;
  Index rows;
  Index block;  ///< rows of a block

  [[nodiscard]] STICTION_HD Index block_begin(Index row) const { return block == rows ? 0 : row - row % block; }
  [[nodiscard]] STICTION_HD Index block_end(Index row) const { return block_begin(row) + block; }
  [[nodiscard]] STICTION_HD Real& at(Index i, Index j) const {
    return data[static_cast<Offset>(i) * block + (j - block_begin(i))];
  }
  [[nodiscard]] STICTION_HD Offset elements() const { return static_cast<Offset>(rows) * block; }
};

/// One environment of a Jacobian batch, and the scratch its work takes.
template <class Real>
struct JacobianEnv {
  Index n;     ///< rows
  Index dofs;  ///< degrees of freedom
  const JacobianBatchView<Real>* batch;
  Offset first_row;
  const Real* M;
  const Real* v_free;
  BlockTriangle<Real> L;  ///< scratch: the factor of M
  Real* columns;          ///< scratch: L^-1 J', column k of all rows together from k n on  (dofs * n)

  /// f(column, value) for the stored entries of a row, in their order.
  template <class F>
  STICTION_HD void for_each_entry(Index row, F&& f) const {
    const Offset begin = batch->row_offsets[first_row + row];
    const Index count =
        batch->column == nullptr ? dofs : static_cast<Index>(batch->row_offsets[first_row + row + 1] - begin);
    for (Index k = 0; k < count; ++k) f(batch->column == nullptr ? k : batch->column[begin + k], batch->J[begin + k]);
  }
};

template <class Real>
STICTION_HD Index mass_block(const JacobianBatchView<Real>& batch, Index dofs) {
  return batch.mass_block == 0 ? (dofs > 0 ? dofs : 1) : batch.mass_block;
}

/// Scratch of one environment, in numbers of Real.
template <class Real>
STICTION_HD Offset jacobian_elements(const JacobianBatchView<Real>& batch, Offset env) {
  const Index dofs = batch.env_dofs(env);
  const Offset vectors = batch.env_rows(env) > 2 ? batch.env_rows(env) : 2;
  return dofs * (mass_block(batch, dofs) + vectors);
}

template <class Real>
STICTION_HD JacobianEnv<Real> slice(const JacobianBatchView<Real>& batch, Offset env, Real* scratch) {
  JacobianEnv<Real> e;
  e.n = batch.env_rows(env);
  e.dofs = batch.env_dofs(env);
  e.batch = &batch;
  e.first_row = batch.env_row_offsets[env];
  e.M = batch.M + batch.env_mass_offsets[env];
  e.v_free = batch.v_free + batch.env_dof_offsets[env];
  e.L = {scratch, e.dofs, mass_block(batch, e.dofs)};
  e.columns = scratch + e.L.elements();
  return e;
}

/// M = L L', right-looking, column by column: entry (i, j) takes its updates in the order of the columns, whoever makes
/// them. Whether every pivot was positive and finite, on every lane; where one was not the factor is unfinished.
template <Block B, class Real>
STICTION_HD bool factor_mass(B& block, const JacobianEnv<Real>& env) {
  const BlockTriangle<Real>& L = env.L;
  for_each(block, L.rows, [&](Index i) {
    for (Index j = L.block_begin(i); j <= i; ++j) L.at(i, j) = env.M[&L.at(i, j) - L.data];
  });
  for (Index k = 0; k < L.rows; ++k) {
    const Real pivot = block.broadcast([&] {
      const Real diagonal = L.at(k, k);
      if (!(diagonal > Real(0)) || !finite_(diagonal)) return Real(0);
      return env.batch->mass_form == MassForm::factor ? diagonal : sqrt_(diagonal);
    });
    if (!(pivot > Real(0))) return false;
    if (env.batch->mass_form == MassForm::factor) continue;
    const Index below = L.block_end(k) - k - 1;
    for_each(block, below + 1, [&](Index i) { L.at(k + i, k) = i == 0 ? pivot : div_(L.at(k + i, k), pivot); });
    for_each(block, below, [&](Index r) {
      const Index i = k + 1 + r;
      const Real factor = Real(0) - L.at(i, k);
      for (Index j = k + 1; j <= i; ++j) L.at(i, j) = fma_(factor, L.at(j, k), L.at(i, j));
    });
  }
  return true;
}

/// Forward substitution on rows [first, first + count) of J, whose entries env.columns holds.
template <Index kTile, class Real>
STICTION_HD void substitute(const JacobianEnv<Real>& env, Index first, Index count) {
  for (Index k = 0; k < env.dofs; ++k) {
    Real* const target = env.columns + static_cast<Offset>(k) * env.n + first;
    Real sum[kTile];
    for (Index t = 0; t < count; ++t) sum[t] = target[t];
    for (Index j = env.L.block_begin(k); j < k; ++j) {
      const Real factor = Real(0) - env.L.at(k, j);
      const Real* const known = env.columns + static_cast<Offset>(j) * env.n + first;
      for (Index t = 0; t < count; ++t) sum[t] = fma_(factor, known[t], sum[t]);
    }
    const Real pivot = env.L.at(k, k);
    for (Index t = 0; t < count; ++t) target[t] = div_(sum[t], pivot);
  }
}

/// env.columns = L^-1 J'. Rows of J are independent; a lane takes kRowTile of them at once.
template <Block B, class Real>
STICTION_HD void solve_rows(B& block, const JacobianEnv<Real>& env) {
  constexpr Index kTile = B::kRowTile;
  const Index n = env.n;
  for_each(block, n, [&](Index i) {
    for (Index k = 0; k < env.dofs; ++k) env.columns[static_cast<Offset>(k) * n + i] = 0;
    env.for_each_entry(i, [&](Index k, Real value) {
      Real& entry = env.columns[static_cast<Offset>(k) * n + i];
      entry = entry + value;
    });
  });
  for_each(block, (n + kTile - 1) / kTile, [&](Index tile) {
    const Index first = tile * kTile;
    if (first + kTile <= n) {
      substitute<kTile>(env, first, kTile);
    } else {
      substitute<kTile>(env, first, n - first);
    }
  });
}

/// A, or Y where the environment is kept as a factor, and b of one environment. What cannot be assembled is flagged and
/// left zero.
template <Block B, class Real>
STICTION_HD void assemble_env(B& block, const JacobianJob<Real>& job, Offset index, Real* scratch) {
  const JacobianEnv<Real> env = slice(job.batch, index, scratch);
  const Index n = env.n;
  Real* const b = job.b + job.rows[index];
  const bool as_factor = job.factor[index + 1] > job.factor[index];
  Real* const entries = as_factor ? job.Y + job.factor[index] : job.A + job.matrix[index];
  const Index width = as_factor ? env.dofs : n;
  const bool sound = factor_mass(block, env);
  if (!sound) {
    single(block, [&] { job.flags[index] |= kFlagBadMass; });
    for_each(block, n, [&](Index i) {
      b[i] = 0;
      for (Index k = 0; k < width; ++k) entries[static_cast<Offset>(i) * width + k] = 0;
    });
    return;
  }
  solve_rows(block, env);
  for_each(block, n, [&](Index i) {
    Real motion(0);
    env.for_each_entry(i, [&](Index k, Real value) { motion = fma_(value, env.v_free[k], motion); });
    b[i] = env.batch->target == nullptr ? motion : motion - env.batch->target[env.first_row + i];
  });
  if (as_factor) {
    for_each(block, n, [&](Index i) {
      for (Index k = 0; k < env.dofs; ++k)
        entries[static_cast<Offset>(i) * width + k] = env.columns[static_cast<Offset>(k) * n + i];
    });
    return;
  }
  for_each(block, n, [&](Index i) {
    Real* const row = entries + static_cast<Offset>(i) * n;
    for (Index j = 0; j <= i; ++j) row[j] = 0;
    for (Index k = 0; k < env.dofs; ++k) {
      const Real* const column = env.columns + static_cast<Offset>(k) * n;
      const Real factor = column[i];
      for (Index j = 0; j <= i; ++j) row[j] = fma_(factor, column[j], row[j]);
    }
  });
  for_each(block, n, [&](Index i) {
    for (Index j = i + 1; j < n; ++j) entries[static_cast<Offset>(i) * n + j] = entries[static_cast<Offset>(j) * n + i];
  });
}

/// motion = J' lambda, summed over the rows in order.
template <Block B, class Real>
STICTION_HD void pull_reactions(B& block, const JacobianEnv<Real>& env, const Real* lambda, Real* motion) {
  if (env.batch->column == nullptr) {
    for_each(block, env.dofs, [&](Index k) {
      Real sum(0);
      for (Index i = 0; i < env.n; ++i)
        sum = fma_(env.batch->J[env.batch->row_offsets[env.first_row + i] + k], lambda[i], sum);
      motion[k] = sum;
    });
    return;
  }
  single(block, [&] {
    for (Index k = 0; k < env.dofs; ++k) motion[k] = 0;
    for (Index i = 0; i < env.n; ++i)
      env.for_each_entry(i, [&](Index k, Real value) { motion[k] = fma_(value, lambda[i], motion[k]); });
  });
}

/// change = L^-T L^-1 motion; destroys motion. An entry that is known is taken out of all the others at once, so that
/// a step ends when its lanes have, and every lane divides for itself, which saves a step in between.
template <Block B, class Real>
STICTION_HD void solve_mass(B& block, const BlockTriangle<Real>& L, Real* motion, Real* change) {
  for (Index k = 0; k < L.rows; ++k) {
    const Real known = div_(motion[k], L.at(k, k));
    for_each(block, L.block_end(k) - k, [&](Index r) {
      const Index i = k + r;
      if (r == 0) {
        change[k] = known;
      } else {
        motion[i] = fma_(Real(0) - L.at(i, k), known, motion[i]);
      }
    });
  }
  for_each(block, L.rows, [&](Index k) { motion[k] = change[k]; });
  for (Index k = L.rows - 1; k >= 0; --k) {
    const Real known = div_(motion[k], L.at(k, k));
    for_each(block, k - L.block_begin(k) + 1, [&](Index r) {
      const Index i = k - r;
      if (r == 0) {
        change[k] = known;
      } else {
        motion[i] = fma_(Real(0) - L.at(k, i), known, motion[i]);
      }
    });
  }
}

/// v+ = v_free + L^-T L^-1 J' lambda of one environment, L being factored anew: that costs less than a sweep, and no
/// factor has to be kept from assembling to the end of a solve.
template <Block B, class Real>
STICTION_HD void velocity_env(B& block, const JacobianJob<Real>& job, Offset index, Real* scratch) {
  const JacobianEnv<Real> env = slice(job.batch, index, scratch);
  const Real* const lambda = job.lambda + job.rows[index];
  Real* const velocity = job.velocity + job.batch.env_dof_offsets[index];
  const Real largest = max_over<Real>(block, env.n, [&](Index i) { return abs_(lambda[i]); });
  const bool moved = largest > Real(0) && factor_mass(block, env);
  Real* const motion = env.columns;
  Real* const change = env.columns + env.dofs;
  if (moved) {
    pull_reactions(block, env, lambda, motion);
    solve_mass(block, env.L, motion, change);
  }
  for_each(block, env.dofs,
           [&](Index k) { velocity[k] = canonical_zero(moved ? env.v_free[k] + change[k] : env.v_free[k]); });
}

}  // namespace stiction::inline STICTION_ISA
