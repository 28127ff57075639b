#pragma once

#include "core/algorithm/jacobian/mass_factor.hpp"
#include "core/job/jacobian_job.hpp"
#include "core/team/reduce.hpp"

/// From J, M and v_free to A and b, and from reactions to velocities (docs/howto/jacobian.md).
namespace stiction::inline STICTION_ISA {

/// One environment of a Jacobian batch, and the scratch its work takes.
template <class Tile>
struct JacobianEnv {
  using Real = typename Tile::Real;
  using Columns = ColumnSet<!Tile::kOneRow>;
  Index n;     ///< rows
  Index dofs;  ///< degrees of freedom
  const JacobianBatchView<Real>* batch;
  Offset first_row;
  const Real* M;
  const Real* v_free;
  std::uint64_t* full;    ///< scratch: columns in which a tile of rows has anything
  BlockTriangle<Tile> L;  ///< scratch: the factor of M
  Real* rows;             ///< scratch: L^-1 J', tile by tile, a tile's entries of a column side by side

  [[nodiscard]] STICTION_HD Index tiles() const { return (n + Tile::kRows - 1) / Tile::kRows; }
  /// Rows of J in a tile.
  [[nodiscard]] STICTION_HD Index tile_rows(Index tile) const {
    const Index left = n - tile * Tile::kRows;
    return left < Tile::kRows ? left : Tile::kRows;
  }
  /// Returns a tile's entries of column 0; those of column k are k step() further on. Tiles of one row lie row by row
  /// of the transpose, so that lanes side by side read side by side.
  [[nodiscard]] STICTION_HD Real* tile(Index tile) const {
    return Tile::kOneRow ? rows + tile : rows + static_cast<Offset>(tile) * Tile::kRows * dofs;
  }
  [[nodiscard]] STICTION_HD Index step() const { return Tile::kOneRow ? n : Tile::kRows; }
  [[nodiscard]] STICTION_HD Columns columns(Index tile) const { return {full + tile * Columns::size(dofs)}; }

  /// f(column, value) for the stored entries of a row, in their order.
  template <class F>
  STICTION_HD void for_each_entry(Index row, F&& f) const {
    const Offset begin = batch->row_offsets[first_row + row];
    const Real* const values = batch->J + begin;
    if (batch->column == nullptr) {
      for (Index k = 0; k < dofs; ++k) f(k, values[k]);
      return;
    }
    const Index count = static_cast<Index>(batch->row_offsets[first_row + row + 1] - begin);
    const Index* const column = batch->column + begin;
    for (Index k = 0; k < count; ++k) f(column[k], values[k]);
  }
};

template <class Real>
STICTION_HD Index mass_block(const JacobianBatchView<Real>& batch, Index dofs) {
  return batch.mass_block == 0 ? (dofs > 0 ? dofs : 1) : batch.mass_block;
}

/// Scratch of one environment, in numbers of Real.
template <class Tile>
STICTION_HD Offset jacobian_elements(const JacobianBatchView<typename Tile::Real>& batch, Offset env) {
  const Index dofs = batch.env_dofs(env);
  const Offset tiles = (static_cast<Offset>(batch.env_rows(env)) + Tile::kRows - 1) / Tile::kRows;
  const Offset vectors = tiles * Tile::kRows > 2 ? tiles * Tile::kRows : 2;
  const Offset words = tiles * JacobianEnv<Tile>::Columns::size(dofs);
  const BlockTriangle<Tile> L{nullptr, dofs, mass_block(batch, dofs)};
  return words * static_cast<Offset>(sizeof(std::uint64_t) / sizeof(typename Tile::Real)) + L.elements() +
         dofs * vectors;
}

template <class Tile>
STICTION_HD JacobianEnv<Tile> slice(const JacobianBatchView<typename Tile::Real>& batch, Offset env,
                                    typename Tile::Real* scratch) {
  JacobianEnv<Tile> e;
  e.n = batch.env_rows(env);
  e.dofs = batch.env_dofs(env);
  e.batch = &batch;
  e.first_row = batch.env_row_offsets[env];
  e.M = batch.M + batch.env_mass_offsets[env];
  e.v_free = batch.v_free + batch.env_dof_offsets[env];
  // Vectors first: they are read most, and the scratch begins where a vector does.
  e.rows = scratch;
  const Offset padded = static_cast<Offset>(e.tiles()) * Tile::kRows;
  e.L = {e.rows + (padded > 2 ? padded : 2) * e.dofs, e.dofs, mass_block(batch, e.dofs)};
  e.full = reinterpret_cast<std::uint64_t*>(e.L.data + e.L.elements());
  return e;
}

/// The rows of J of a tile, and the columns in which they have anything.
template <class Tile>
STICTION_HD void load_rows(const JacobianEnv<Tile>& env, Index tile) {
  using Wide = typename Tile::Wide;
  using Real = typename Tile::Real;
  Real* const x = env.tile(tile);
  const Index step = env.step(), first = tile * Tile::kRows, count = env.tile_rows(tile);
  const auto full = env.columns(tile);
  if (env.batch->column == nullptr) {
    const Offset* const begin = env.batch->row_offsets + env.first_row + first;
    turn_rows<Tile>(count, env.dofs, [&](Index r) { return env.batch->J + begin[r]; }, x, step);
    full.fill(env.dofs, [&](Index k) {
      Mask<Wide> some = Wide(0) != Wide(0);
      for (Index v = 0; v < Tile::kRows; v += Tile::kLanes) {
        Wide entries;
        load_lanes(x + static_cast<Offset>(k) * step + v, entries);
        some = or_(some, entries != Wide(0));
      }
      return any(some);
    });
    return;
  }
  for (Index k = 0; k < env.dofs; ++k)
    for (Index r = 0; r < Tile::kRows; ++r) x[static_cast<Offset>(k) * step + r] = 0;
  full.clear(env.dofs);
  for (Index r = 0; r < count; ++r)
    env.for_each_entry(first + r, [&](Index k, Real value) {
      Real& entry = x[static_cast<Offset>(k) * step + r];
      entry = entry + value;
      full.put(k);
    });
}

/// L^-1 J'. Rows of J are independent; a lane takes a tile of them at once.
template <class Tile, Team TeamT>
STICTION_HD void solve_rows(TeamT& team, const JacobianEnv<Tile>& env) {
  for_each(team, env.tiles(), [&](Index tile) {
    load_rows(env, tile);
    substitute(env.L, env.tile(tile), env.step(), env.columns(tile));
  });
}

/// The first `count` lanes to memory.
template <class Wide>
STICTION_HD void store_some(Scalar<Wide>* to, Wide value, Index count) {
  if (count >= RealTraits<Wide>::kLanes) {
    store_lanes(to, value);
    return;
  }
  Scalar<Wide> lanes[RealTraits<Wide>::kLanes];
  store_lanes(lanes, value);
  for (Index l = 0; l < count; ++l) to[l] = lanes[l];
}

/// The rows of a tile against those of another that does not come after it: a block of A, and where it is mirrored.
template <class Tile>
STICTION_HD void multiply_tiles(const JacobianEnv<Tile>& env, Index left, Index right, typename Tile::Real* A) {
  using Wide = typename Tile::Wide;
  using Real = typename Tile::Real;
  constexpr Index kGroup = Tile::kLanes, kVectors = Tile::kVectors;
  const Index n = env.n, step = env.step();
  const Real* const one = env.tile(left);
  const Real* const two = env.tile(right);
  const auto full = env.columns(left);
  for (Index group = 0; group < env.tile_rows(left); group += kGroup) {
    Wide sum[kGroup][kVectors];
    for (Index r = 0; r < kGroup; ++r)
      for (Index v = 0; v < kVectors; ++v) sum[r][v] = Wide(0);
    full.for_each_shared(env.columns(right), env.dofs, [&](Index k) {
      const Real* const factor = one + static_cast<Offset>(k) * step + group;
      for (Index v = 0; v < kVectors; ++v) {
        Wide other;
        load_lanes(two + static_cast<Offset>(k) * step + v * Tile::kLanes, other);
        for (Index r = 0; r < kGroup; ++r) sum[r][v] = fma_(Wide(factor[r]), other, sum[r][v]);
      }
    });
    const Index row = left * Tile::kRows + group, rows = n - row < kGroup ? n - row : kGroup;
    for (Index v = 0; v < kVectors; ++v) {
      const Index column = right * Tile::kRows + v * Tile::kLanes;
      Real entries[kGroup][Tile::kLanes];
      for (Index r = 0; r < kGroup; ++r) {
        sum[r][v] = canonical_zero(sum[r][v]);
        store_lanes(entries[r], sum[r][v]);
        if (r < rows) store_some(A + static_cast<Offset>(row + r) * n + column, sum[r][v], n - column);
      }
      for (Index l = 0; left != right && l < Tile::kLanes; ++l)
        for (Index r = 0; r < rows; ++r) A[static_cast<Offset>(column + l) * n + row + r] = entries[r][l];
    }
  }
}

/// A = Y Y': one triangle of tiles, each computed once.
template <class Tile, Team TeamT>
STICTION_HD void multiply_rows(TeamT& team, const JacobianEnv<Tile>& env, typename Tile::Real* A) {
  const Index tiles = env.tiles();
  // The triangle folded into a rectangle: row T - 1 - q and, behind it, the row of the length that is left.
  const Index width = tiles % 2 == 0 ? tiles + 1 : tiles;
  for_each(team, (tiles + 1) / 2 * width, [&](Index at) {
    const Index q = at / width, place = at % width;
    const bool longer = place < tiles - q;
    const Index left = longer ? tiles - 1 - q : (tiles % 2 == 0 ? q : q - 1);
    const Index right = longer ? place : place - (tiles - q);
    multiply_tiles(env, left, right, A);
  });
}

/// Y, row by row.
template <class Tile, Team TeamT>
STICTION_HD void write_factor(TeamT& team, const JacobianEnv<Tile>& env, typename Tile::Real* Y) {
  for_each(team, env.tiles(), [&](Index tile) {
    const typename Tile::Real* const x = env.tile(tile);
    for (Index r = 0; r < env.tile_rows(tile); ++r) {
      typename Tile::Real* const row = Y + static_cast<Offset>(tile * Tile::kRows + r) * env.dofs;
      for (Index k = 0; k < env.dofs; ++k) row[k] = canonical_zero(x[static_cast<Offset>(k) * env.step() + r]);
    }
  });
}

/// A, or Y where the environment is kept as a factor, and b of one environment. An environment that cannot be
/// assembled is flagged and left zero.
template <class Tile, Team TeamT>
STICTION_HD void assemble_env(TeamT& team, const JacobianJob<typename Tile::Real>& job, Offset index,
                              typename Tile::Real* scratch) {
  using Real = typename Tile::Real;
  const JacobianEnv<Tile> env = slice<Tile>(job.batch, index, scratch);
  const Index n = env.n;
  Real* const b = job.b + job.rows[index];
  const bool as_factor = job.factor[index + 1] > job.factor[index];
  Real* const entries = as_factor ? job.Y + job.factor[index] : job.A + job.matrix[index];
  if (!factor_mass(team, env.L, env.M, job.batch.mass_form)) {
    const Index width = as_factor ? env.dofs : n;
    single(team, [&] { job.flags[index] |= kFlagBadMass; });
    for_each(team, n, [&](Index i) {
      b[i] = 0;
      for (Index k = 0; k < width; ++k) entries[static_cast<Offset>(i) * width + k] = 0;
    });
    return;
  }
  solve_rows(team, env);
  for_each(team, n, [&](Index i) {
    Real motion(0);
    env.for_each_entry(i, [&](Index k, Real value) { motion = fma_(value, env.v_free[k], motion); });
    b[i] = env.batch->target == nullptr ? motion : motion - env.batch->target[env.first_row + i];
  });
  if (as_factor) {
    write_factor(team, env, entries);
  } else {
    multiply_rows(team, env, entries);
  }
}

/// motion = J' lambda, summed over the rows in order.
template <class Tile, Team TeamT>
STICTION_HD void pull_reactions(TeamT& team, const JacobianEnv<Tile>& env, const typename Tile::Real* lambda,
                                typename Tile::Real* motion) {
  using Wide = typename Tile::Wide;
  using Real = typename Tile::Real;
  if (env.batch->column == nullptr) {
    const Offset* const begin = env.batch->row_offsets + env.first_row;
    const Index vectors = env.dofs / Tile::kLanes, rest = env.dofs - vectors * Tile::kLanes;
    for_each(team, vectors, [&](Index vector) {
      const Index first = vector * Tile::kLanes;
      Wide sum(0);
      for (Index i = 0; i < env.n; ++i) {
        Wide entry;
        load_lanes(env.batch->J + begin[i] + first, entry);
        sum = fma_(entry, Wide(lambda[i]), sum);
      }
      store_lanes(motion + first, sum);
    });
    for_each(team, rest, [&](Index k) {
      const Index last = vectors * Tile::kLanes + k;
      Real sum(0);
      for (Index i = 0; i < env.n; ++i) sum = fma_(env.batch->J[begin[i] + last], lambda[i], sum);
      motion[last] = sum;
    });
    return;
  }
  single(team, [&] {
    for (Index k = 0; k < env.dofs; ++k) motion[k] = 0;
    for (Index i = 0; i < env.n; ++i)
      env.for_each_entry(i, [&](Index k, Real value) { motion[k] = fma_(value, lambda[i], motion[k]); });
  });
}

/// Computes v+ = v_free + L^-T L^-1 J' lambda of one environment, L being factored anew. This costs less than a sweep,
/// and no factor has to be kept from assembling to the end of a solve.
template <class Tile, Team TeamT>
STICTION_HD void velocity_env(TeamT& team, const JacobianJob<typename Tile::Real>& job, Offset index,
                              typename Tile::Real* scratch) {
  using Real = typename Tile::Real;
  const JacobianEnv<Tile> env = slice<Tile>(job.batch, index, scratch);
  const Real* const lambda = job.lambda + job.rows[index];
  Real* const velocity = job.velocity + job.batch.env_dof_offsets[index];
  const Real largest = max_over<Real>(team, env.n, [&](Index i) { return abs_(lambda[i]); });
  const bool moved = largest > Real(0) && factor_mass(team, env.L, env.M, job.batch.mass_form);
  Real* const motion = env.rows;
  Real* const change = env.rows + env.dofs;
  if (moved) {
    pull_reactions(team, env, lambda, motion);
    solve_mass(team, env.L, motion, change);
  }
  for_each(team, env.dofs,
           [&](Index k) { velocity[k] = canonical_zero(moved ? env.v_free[k] + change[k] : env.v_free[k]); });
}

}  // namespace stiction::inline STICTION_ISA
