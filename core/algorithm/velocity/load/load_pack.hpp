#pragma once

#include <type_traits>

#include "core/algorithm/problem/bounds.hpp"
#include "core/algorithm/velocity/lanes/velocity_workspace.hpp"
#include "core/base/transpose.hpp"

/// Environments into the lanes of a pack.
namespace stiction::inline STICTION_ISA {

/// Numbers that a tile reads from a row of an environment, at most. It may reach beyond the row: numbers there are
/// moved along and not used.
template <class Real>
inline constexpr Index kTileReach = kMostVelocityDofs + kTileEdge<Real>;

/// A row of every lane, and how many numbers the array has from there on. Column c is kStep c numbers further on: with
/// -1 the columns of a row lie from its last number to its first.
template <class Types, Index kStep>
struct LaneRows {
  using Real = typename Types::Real;
  const Real* row[Types::kLanes];
  Offset rest[Types::kLanes];

  /// The row whose column 0 is at `offset` of an array of that size.
  STICTION_HD void set(int lane, const Real* array, Offset offset, Offset size) {
    row[lane] = array + offset;
    rest[lane] = kStep > 0 ? size - offset : offset + 1;
  }
  /// Numbers in the place of an array's: kTileReach of them.
  STICTION_HD void set(int lane, const Real* numbers) {
    row[lane] = kStep > 0 ? numbers : numbers + (kTileReach<Real> - 1);
    rest[lane] = kTileReach<Real>;
  }
};

/// f(kStep) of a batch's rows, as an integral constant.
template <class F>
STICTION_HD void with_step(MassForm mass, F&& f) {
  if (mass == MassForm::factor) {
    f(std::integral_constant<Index, -1>{});
  } else {
    f(std::integral_constant<Index, 1>{});
  }
}

/// Column columns[c] of every lane's row to to(c), its first lane's number; `count` columns in ascending order, tile by
/// tile where they lie close.
template <class Types, Index kStep, class To>
STICTION_HD void load_columns(const LaneRows<Types, kStep>& from, const SmallOf<Types>* columns, Index count,
                              const To& to) {
  using Real = typename Types::Real;
  constexpr Index kEdge = kTileEdge<Real>;
  using Number = typename Types::Number;
  constexpr int kLanes = Types::kLanes;
  constexpr Index kTaken = kLanes < kEdge ? kLanes : kEdge;  // rows of a tile
  const auto load_one = [&](Index c) {
    for (int l = 0; l < kLanes; ++l) to(c)[l] = static_cast<Number>(from.row[l][kStep * Index{columns[c]}]);
  };
  if constexpr (kTaken == 1 || kLanes % kTaken != 0) {
    for (Index c = 0; c < count; ++c) load_one(c);
  } else {
    if (count == 0) return;
    // Numbers beyond the array are not read.
    const Index reach = columns[count - 1] + kEdge;
    Real copies[kLanes][kTileReach<Real>];
    const Real* rows[kLanes];
    for (int l = 0; l < kLanes; ++l) {
      rows[l] = from.row[l];
      if (from.rest[l] >= reach) continue;
      Real* const copy = kStep > 0 ? copies[l] : copies[l] + (reach - 1);
      for (Index i = 0; i < reach; ++i) copy[kStep * i] = i < from.rest[l] ? rows[l][kStep * i] : Real(0);
      rows[l] = copy;
    }
    for (Index c = 0; c < count;) {
      const Index first = columns[c];
      Index inside = 1;
      while (c + inside < count && columns[c + inside] < first + kEdge) ++inside;
      if (inside == 1) load_one(c);
      for (int lane = 0; inside > 1 && lane < kLanes; lane += kTaken) {
        const Real* tile[kEdge];
        Real turned[kEdge][kEdge];
        constexpr Index kFirst = kStep > 0 ? 0 : kEdge - 1;  // where the tile has its first column
        for (Index i = 0; i < kEdge; ++i) tile[i] = rows[lane + (i < kTaken ? i : 0)] + (kStep * first - kFirst);
        transpose_tile(tile, turned);
        for (Index k = 0; k < inside; ++k) {
          Pack<Real, kTaken> column;
          load_lanes(turned[kFirst + kStep * (columns[c + k] - first)], column);
          put_numbers(column, to(c + k) + lane);
        }
      }
      c += inside;
    }
  }
}

/// The rows of number k in M, or in its factor. Returns true if each lane with k has M in one block, and a full factor:
/// nothing is read before an array's first number.
template <class Types, Index kStep, class Real>
STICTION_HD bool set_mass_rows(LaneRows<Types, kStep>& from, const JacobianBatchView<Real>& batch, Index dofs,
                               const LaneEnv<Real> (&envs)[Types::kLanes], Index k,
                               const Real (&zeros)[kTileReach<Real>]) {
  bool is_dense = true;
  for (int l = 0; l < Types::kLanes; ++l) {
    const bool has = k < envs[l].dofs;
    from.set(l, zeros);
    is_dense = is_dense && (!has || (envs[l].is_one_block && (kStep > 0 || envs[l].dofs == dofs)));
    if (has && envs[l].is_one_block)
      from.set(l, batch.M, (envs[l].M - batch.M) + mass_row(envs[l], k), batch.mass_count);
  }
  return is_dense;
}

/// M's lower triangle in the tree's envelope. Degrees of freedom that a lane does not have get a 1 on the diagonal.
template <class Types, class Real>
STICTION_HD_OUTLINE void load_mass(const VelocityWorkspace<Types>& workspace, const JacobianBatchView<Real>& batch,
                                   const TreeOf<Types>& tree, const LaneEnv<Real> (&envs)[Types::kLanes],
                                   const Real (&zeros)[kTileReach<Real>]) {
  using Number = typename Types::Number;
  workspace.each(tree.dofs, [&](Index k) {
    const SmallOf<Types>* const path = tree.path(k);
    const typename Types::Numbers row = workspace.M.from(tree.begin[k]);
    LaneRows<Types, 1> from;
    if (set_mass_rows(from, batch, tree.dofs, envs, k, zeros)) {
      const Index first = tree.first(k);
      load_columns<Types>(from, path + first, tree.depth[k] + 1 - first,
                          [&](Index c) { return &row.at(first + c, 0); });
    } else {
      for (int l = 0; l < Types::kLanes; ++l)
        for (Index d = tree.first(k); d <= tree.depth[k]; ++d)
          row.at(d, l) = static_cast<Number>(k < envs[l].dofs ? mass_entry(envs[l], k, path[d]) : Real(0));
    }
    for (int l = 0; l < Types::kLanes; ++l)
      if (k >= envs[l].dofs) row.at(tree.depth[k], l) = Number(1);
  });
}

/// A factor in the tree's envelope. Its row of number k is a column here: it has the entries of k and of its members
/// below k in the tree. Degrees of freedom that a lane does not have get a 1 on the diagonal.
template <class Types, class Real>
STICTION_HD_OUTLINE void load_factor(const VelocityWorkspace<Types>& workspace, const JacobianBatchView<Real>& batch,
                                     const TreeOf<Types>& tree, const LaneEnv<Real> (&envs)[Types::kLanes],
                                     const Real (&zeros)[kTileReach<Real>]) {
  using Number = typename Types::Number;
  workspace.each(tree.dofs, [&](Index k) {
    const Index depth = tree.depth[k];
    SmallOf<Types> below[TreeOf<Types>::kMostDofs];
    Index count = 0;
    for (Index i = k; i < tree.dofs; ++i)
      if (tree.has(i, depth) && tree.path(i)[depth] == k) below[count++] = static_cast<SmallOf<Types>>(i);
    const auto entry = [&](Index c) { return &workspace.M.at(tree.begin[below[c]] + depth, 0); };
    LaneRows<Types, -1> from;
    if (set_mass_rows(from, batch, tree.dofs, envs, k, zeros)) {
      load_columns<Types>(from, below, count, entry);
    } else {
      for (int l = 0; l < Types::kLanes; ++l)
        for (Index c = 0; c < count; ++c)
          entry(c)[l] =
              static_cast<Number>(below[c] < envs[l].dofs ? mass_entry(envs[l], Index{below[c]}, k) : Real(0));
    }
  });
  workspace.each(tree.dofs, [&](Index k) {
    for (int l = 0; l < Types::kLanes; ++l)
      if (k >= envs[l].dofs) workspace.M.at(tree.diagonal(k), l) = Number(1);
  });
}

/// M, or its factor, and v_free.
template <class Types, class Real>
STICTION_HD void load_motion(const VelocityWorkspace<Types>& workspace, const JacobianBatchView<Real>& batch,
                             const TreeOf<Types>& tree, const LaneEnv<Real> (&envs)[Types::kLanes],
                             const Real (&zeros)[kTileReach<Real>]) {
  if (batch.mass_form == MassForm::matrix) load_mass(workspace, batch, tree, envs, zeros);
  if (batch.mass_form == MassForm::factor) load_factor(workspace, batch, tree, envs, zeros);
  for (int l = 0; l < Types::kLanes; ++l)
    workspace.each(tree.dofs, [&](Index k) {
      workspace.v_free.at(k, l) =
          static_cast<typename Types::Number>(k < envs[l].dofs ? envs[l].v_free[dof_of(envs[l], k)] : Real(0));
    });
}

/// A row of J by its stored entries; such as name a column twice add up.
template <class Set, class Numbers, class Real>
STICTION_HD void load_stored(const JacobianBatchView<Real>& batch, const LaneEnv<Real>& env, Offset row,
                             const Set& dofs, const Numbers& to, int lane) {
  using Number = std::remove_reference_t<decltype(to.at(0, 0))>;
  const Index columns = size_of(dofs);
  for (Index c = 0; c < columns; ++c) to.at(c, lane) = Number(0);
  for (Offset k = batch.row_offsets[row]; k < batch.row_offsets[row + 1]; ++k) {
    if (batch.J[k] == Real(0)) continue;
    Number& entry = to.at(size_of(dofs & below<Set>(local_of(env, batch.column[k]))), lane);
    entry = entry + static_cast<Number>(batch.J[k]);
  }
}

/// Row k of a slot in every lane.
template <class Types, class Real>
STICTION_HD void load_row(const VelocityWorkspace<Types>& workspace, const JacobianBatchView<Real>& batch,
                          const SlotOf<Types>& slot, Index k, const LaneEnv<Real> (&envs)[Types::kLanes],
                          const Real (&zeros)[kTileReach<Real>]) {
  const typename Types::Numbers entries = workspace.J.from(slot.entry + static_cast<Offset>(k) * slot.columns);
  bool is_consecutive = batch.column == nullptr;
  for (int l = 0; l < Types::kLanes; ++l)
    is_consecutive = is_consecutive && (slot.row_of[l] < 0 || envs[l].is_consecutive);
  const auto begin = [&](int l) { return batch.row_offsets[envs[l].first_row + slot.row_of[l] + k]; };
  if (is_consecutive) {
    with_step(batch.mass_form, [&](auto step) {
      LaneRows<Types, decltype(step)::value> from;
      for (int l = 0; l < Types::kLanes; ++l) {
        from.set(l, zeros);
        if (slot.row_of[l] >= 0) from.set(l, batch.J, begin(l) + dof_of(envs[l], 0), batch.entry_count);
      }
      load_columns<Types>(from, slot.dof, slot.columns, [&](Index c) { return &entries.at(c, 0); });
    });
    return;
  }
  for (int l = 0; l < Types::kLanes; ++l) {
    if (slot.row_of[l] >= 0 && batch.column != nullptr) {
      load_stored(batch, envs[l], envs[l].first_row + slot.row_of[l] + k, slot.dofs, entries, l);
      continue;
    }
    for (Index c = 0; c < slot.columns; ++c)
      entries.at(c, l) = static_cast<typename Types::Number>(
          slot.row_of[l] < 0 ? Real(0) : batch.J[begin(l) + dof_of(envs[l], slot.dof[c])]);
  }
}

/// A slot's numbers of an array by row, `otherwise` in lanes without its cone, or where there is no array.
template <class Types, class Real>
STICTION_HD void load_by_row(const SlotOf<Types>& slot, const LaneEnv<Real> (&envs)[Types::kLanes], const Real* array,
                             Real otherwise, const typename Types::Numbers& to) {
  if (array == nullptr) {
    for (Index k = 0; k < slot.rows; ++k)
      to.put(slot.row + k, typename Types::Wide(static_cast<typename Types::Number>(otherwise)));
    return;
  }
  Real others[kMaxConeRows];
  for (Real& number : others) number = otherwise;
  const Real* from[Types::kLanes];
  for (int l = 0; l < Types::kLanes; ++l)
    from[l] = slot.row_of[l] >= 0 ? array + envs[l].first_row + slot.row_of[l] : others;
  for (Index k = 0; k < slot.rows; ++k)
    for (int l = 0; l < Types::kLanes; ++l) to.at(slot.row + k, l) = static_cast<typename Types::Number>(from[l][k]);
}

/// Bounds of a row by its kind.
template <class Real>
struct Bounds {
  Real lo;
  Real hi;
};
template <class Real>
STICTION_HD Bounds<Real> bounds_of(const JacobianBatchView<Real>& batch, ConeKind kind, Offset row) {
  const Real infinite = static_cast<Real>(__builtin_huge_val());
  if (kind == ConeKind::box) return {lower_or_none(batch.lo[row]), upper_or_none(batch.hi[row])};
  return {kind == ConeKind::free ? Real(0) - infinite : Real(0), infinite};
}

/// J and everything by row. Lanes without a cone in a slot get zeros, and a row between bounds 0 and 0.
template <class Types, class Real>
STICTION_HD_OUTLINE void load_slot(const VelocityWorkspace<Types>& workspace, const JacobianBatchView<Real>& batch,
                                   const SlotOf<Types>& slot, Index index, const LaneEnv<Real> (&envs)[Types::kLanes],
                                   const Real (&zeros)[kTileReach<Real>]) {
  using Wide = typename Types::Wide;
  for (Index k = 0; k < slot.rows; ++k) load_row(workspace, batch, slot, k, envs, zeros);
  load_by_row<Types, Real>(slot, envs, batch.target, Real(0), workspace.target);
  load_by_row<Types, Real>(slot, envs, batch.R, Real(1), workspace.R);
  load_by_row<Types, Real>(slot, envs, slot.rows > 1 ? batch.mu : nullptr, Real(1), workspace.mu);
  workspace.mu.put(slot.row, Wide(1));
  for (Index row = slot.row; row < slot.row + slot.rows; ++row) {
    workspace.shift.put(row, Wide(0));
    workspace.prox.put(row, Wide(0));
    workspace.prox_center.put(row, Wide(0));
  }
  if (slot.rows > 1) return;
  for (int l = 0; l < Types::kLanes; ++l) {
    const bool has = slot.row_of[l] >= 0;
    const Bounds<Real> bounds = has ? bounds_of(batch, batch.cone_kind[envs[l].first_cone + slot.cone_of[l]],
                                                envs[l].first_row + slot.row_of[l])
                                    : Bounds<Real>{Real(0), Real(0)};
    workspace.law.at(3 * index + 1, l) = static_cast<typename Types::Number>(bounds.lo);
    workspace.law.at(3 * index + 2, l) = static_cast<typename Types::Number>(bounds.hi);
  }
}

/// The lanes all of whose numbers may be computed with: finite, friction and compliance not negative, bounds in order.
template <class Types>
STICTION_HD_OUTLINE Mask<typename Types::Wide> sound_lanes(const VelocityWorkspace<Types>& workspace,
                                                           const TreeOf<Types>& tree, const SlotOf<Types>* slots,
                                                           const SlotCounts& counts) {
  using Wide = typename Types::Wide;
  Wide nothing(0);  // NaN where anything is not finite
  workspace.share(tree.entries, [&](Index e) { nothing = fma_(workspace.M[e], Wide(0), nothing); });
  workspace.share(tree.dofs, [&](Index k) { nothing = fma_(workspace.v_free[k], Wide(0), nothing); });
  workspace.share(static_cast<Index>(counts.entries),
                  [&](Index e) { nothing = fma_(workspace.J[e], Wide(0), nothing); });
  Mask<Wide> sound = Wide(0) == Wide(0);
  workspace.share(counts.rows, [&](Index row) {
    nothing = fma_(workspace.target[row], Wide(0), nothing);
    nothing = fma_(workspace.R[row], Wide(0), nothing);
    nothing = fma_(workspace.mu[row], Wide(0), nothing);
    sound = and_(sound, and_(workspace.R[row] >= Wide(0), workspace.mu[row] >= Wide(0)));
  });
  workspace.share(counts.slots, [&](Index s) {
    if (slots[s].rows == 1) sound = and_(sound, workspace.law[3 * s + 1] <= workspace.law[3 * s + 2]);
  });
  return workspace.all(and_(sound, nothing == Wide(0)));
}

}  // namespace stiction::inline STICTION_ISA
