#pragma once

#include "core/algorithm/velocity/velocity_workspace.hpp"
#include "core/base/transpose.hpp"

/// Environments into the lanes of a pack.
namespace stiction::inline STICTION_ISA {

/// Numbers from[l][column] of every lane to `to`, for `count` columns in ascending order; the row has `width` of them.
/// Columns that lie close are turned over tile by tile. A lane without a row has a null pointer and gets zeros.
template <class Types, class Real>
STICTION_HD void load_columns(const Real* const (&from)[Types::kLanes], const unsigned char* columns, Index count,
                              Index width, const typename Types::Numbers& to) {
  constexpr Index kEdge = kTileEdge<Real>;
  constexpr int kLanes = Types::kLanes;
  Index c = 0;
  while (c < count) {
    if constexpr (kEdge > 1 && kLanes % kEdge == 0) {
      // A tile that begins at this column, or ends where the row does.
      const Index first = columns[c] + kEdge <= width ? columns[c] : width - kEdge;
      Index inside = 1;
      while (c + inside < count && columns[c + inside] < first + kEdge) ++inside;
      if (inside > 1 && first >= 0) {
        for (int lane = 0; lane < kLanes; lane += kEdge) {
          const Real zeros[kEdge] = {};
          const Real* rows[kEdge];
          Real turned[kEdge][kEdge];
          for (Index i = 0; i < kEdge; ++i) rows[i] = from[lane + i] == nullptr ? zeros : from[lane + i] + first;
          transpose_tile(rows, turned);
          for (Index k = 0; k < inside; ++k)
            for (Index i = 0; i < kEdge; ++i) to.at(c + k, lane + i) = turned[columns[c + k] - first][i];
        }
        c += inside;
        continue;
      }
    }
    for (int l = 0; l < kLanes; ++l) to.at(c, l) = from[l] == nullptr ? Real(0) : from[l][columns[c]];
    ++c;
  }
}

/// M's lower triangle in the tree's envelope. Degrees of freedom that a lane does not have get a 1 on the diagonal.
template <class Types, class Real>
STICTION_HD_OUTLINE void load_mass(const VelocityWorkspace<Types>& workspace, const DofTree& tree,
                                   const LaneEnv<Real> (&envs)[Types::kLanes]) {
  for (Index k = 0; k < tree.dofs; ++k) {
    const unsigned char* const path = tree.path(k);
    const typename Types::Numbers row = workspace.M.from(tree.begin[k]);
    const Real* from[Types::kLanes];
    bool is_dense = true;
    for (int l = 0; l < Types::kLanes; ++l) {
      const bool has = k < envs[l].dofs;
      from[l] = has ? envs[l].M + static_cast<Offset>(k) * envs[l].block : nullptr;
      is_dense = is_dense && (!has || envs[l].block == envs[l].dofs);
      workspace.v_free.at(k, l) = has ? envs[l].v_free[k] : Real(0);
    }
    if (is_dense) {
      // Only what lies before the diagonal is read.
      load_columns<Types>(from, path, tree.depth[k] + 1, k + 1, row);
    } else {
      for (int l = 0; l < Types::kLanes; ++l) {
        const Index begin = from[l] == nullptr ? 0 : k / envs[l].block * envs[l].block;
        for (Index d = 0; d <= tree.depth[k]; ++d)
          row.at(d, l) = from[l] != nullptr && path[d] >= begin ? from[l][path[d] - begin] : Real(0);
      }
    }
    for (int l = 0; l < Types::kLanes; ++l)
      if (from[l] == nullptr) row.at(tree.depth[k], l) = Real(1);
  }
}

/// A row of J by its stored entries; such as name a column twice add up.
template <class Numbers, class Real>
STICTION_HD void load_stored(const JacobianBatchView<Real>& batch, Offset row, DofSet dofs, const Numbers& to,
                             int lane) {
  const Index columns = size_of(dofs);
  for (Index c = 0; c < columns; ++c) to.at(c, lane) = Real(0);
  for (Offset k = batch.row_offsets[row]; k < batch.row_offsets[row + 1]; ++k) {
    if (batch.J[k] == Real(0)) continue;
    Real& entry = to.at(size_of(dofs & below(batch.column[k])), lane);
    entry = entry + batch.J[k];
  }
}

/// Row k of a slot in every lane.
template <class Types, class Real>
STICTION_HD void load_row(const VelocityWorkspace<Types>& workspace, const JacobianBatchView<Real>& batch,
                          const Slot<Types::kLanes>& slot, Index k, const LaneEnv<Real> (&envs)[Types::kLanes]) {
  const typename Types::Numbers entries = workspace.J.from(slot.entry + static_cast<Offset>(k) * slot.columns);
  const Real* from[Types::kLanes];
  Index width = kMostVelocityDofs;
  for (int l = 0; l < Types::kLanes; ++l) {
    const bool has = slot.row_of[l] >= 0;
    const Offset row = has ? envs[l].first_row + slot.row_of[l] + k : 0;
    from[l] = has ? batch.J + batch.row_offsets[row] : nullptr;
    if (has && envs[l].dofs < width) width = envs[l].dofs;
    if (has && batch.column != nullptr) load_stored(batch, row, slot.dofs, entries, l);
  }
  if (batch.column == nullptr) {
    load_columns<Types>(from, slot.dof, slot.columns, width, entries);
    return;
  }
  for (int l = 0; l < Types::kLanes; ++l)
    for (Index c = 0; c < slot.columns && from[l] == nullptr; ++c) entries.at(c, l) = Real(0);
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
  if (kind == ConeKind::box) return {batch.lo[row], batch.hi[row]};
  return {kind == ConeKind::free ? Real(0) - infinite : Real(0), infinite};
}

/// J and everything by row. Lanes without a cone in a slot get zeros, and a row between bounds 0 and 0.
template <class Types, class Real>
STICTION_HD_OUTLINE void load_slot(const VelocityWorkspace<Types>& workspace, const JacobianBatchView<Real>& batch,
                                   const Slot<Types::kLanes>& slot, Index index,
                                   const LaneEnv<Real> (&envs)[Types::kLanes]) {
  for (Index k = 0; k < slot.rows; ++k) load_row(workspace, batch, slot, k, envs);
  for (int l = 0; l < Types::kLanes; ++l) {
    const bool has = slot.row_of[l] >= 0;
    const Offset first = has ? envs[l].first_row + slot.row_of[l] : 0;
    const ConeKind kind = has ? batch.cone_kind[envs[l].first_cone + slot.cone_of[l]] : ConeKind::box;
    for (Index k = 0; k < slot.rows; ++k) {
      const Index row = slot.row + k;
      workspace.target.at(row, l) = has && batch.target != nullptr ? batch.target[first + k] : Real(0);
      workspace.R.at(row, l) = has ? batch.R[first + k] : Real(1);
      workspace.mu.at(row, l) = has && kind == ConeKind::friction && k > 0 ? batch.mu[first + k] : Real(1);
      workspace.shift.at(row, l) = Real(0);
      workspace.prox.at(row, l) = Real(0);
      workspace.held.at(row, l) = Real(0);
    }
    if (slot.rows > 1) continue;
    const Bounds<Real> bounds = has ? bounds_of(batch, kind, first) : Bounds<Real>{Real(0), Real(0)};
    workspace.law.at(3 * index + 1, l) = bounds.lo;
    workspace.law.at(3 * index + 2, l) = bounds.hi;
  }
}

/// The lanes all of whose numbers may be computed with: finite, friction and compliance not negative, bounds in order.
template <class Types>
STICTION_HD_OUTLINE Mask<typename Types::Wide> sound_lanes(const VelocityWorkspace<Types>& workspace,
                                                           const DofTree& tree, const Slot<Types::kLanes>* slots,
                                                           const SlotCounts& counts) {
  using Wide = typename Types::Wide;
  Wide nothing(0);  // NaN where anything is not finite
  for (Index e = 0; e < tree.entries; ++e) nothing = fma_(workspace.M[e], Wide(0), nothing);
  for (Index k = 0; k < tree.dofs; ++k) nothing = fma_(workspace.v_free[k], Wide(0), nothing);
  for (Offset e = 0; e < counts.entries; ++e) nothing = fma_(workspace.J[e], Wide(0), nothing);
  Mask<Wide> sound = Wide(0) == Wide(0);
  for (Index row = 0; row < counts.rows; ++row) {
    nothing = fma_(workspace.target[row], Wide(0), nothing);
    nothing = fma_(workspace.R[row], Wide(0), nothing);
    nothing = fma_(workspace.mu[row], Wide(0), nothing);
    sound = and_(sound, and_(workspace.R[row] >= Wide(0), workspace.mu[row] >= Wide(0)));
  }
  for (Index s = 0; s < counts.slots; ++s)
    if (slots[s].rows == 1) sound = and_(sound, workspace.law[3 * s + 1] <= workspace.law[3 * s + 2]);
  return and_(sound, nothing == Wide(0));
}

}  // namespace stiction::inline STICTION_ISA
