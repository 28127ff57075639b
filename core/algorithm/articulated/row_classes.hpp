#pragma once

#include "core/algorithm/articulated/constants.hpp"
#include "core/algorithm/articulated/touch.hpp"
#include "core/algorithm/velocity/lanes/velocity_workspace.hpp"

/// Which rows of a pack's robots lie side by side.
namespace stiction::inline STICTION_ISA {

/// The lanes that have the rows of a group of the pack.
template <class Real, int kStride>
STICTION_HD Mask<Real> lanes_with(const Robots<Real, kStride>& robots, const RowClass& rows, const RowGroup& group) {
  if (rows.source == RowSource::limit) return robots.work.limited[group.index];
  if (rows.source == RowSource::contact) return robots.work.touches[group.index];
  if (rows.source == RowSource::loss) return friction_loss_of(robots, group.index) > Real(0);
  return Real(0) == Real(0);
}
/// Returns true if some lane has the rows of a group.
template <class Real, int kStride>
STICTION_HD bool is_in_pack(const Robots<Real, kStride>& robots, const RowClass& rows, const RowGroup& group) {
  if (rows.source == RowSource::limit) return robots.work.is_limit[group.index] != 0;
  if (rows.source == RowSource::contact) return robots.work.is_point[group.index] != 0;
  return rows.source != RowSource::loss || any(lanes_with(robots, rows, group));
}

/// Ranks groups of a class in every lane, those that the lane has. Returns the most that a lane has.
template <class Real, int kStride>
STICTION_HD Index rank_groups(const Robots<Real, kStride>& robots, const RowClass& rows) {
  Real count(0);
  Index most = 0;
  for (Index g = rows.begin; g < rows.end; ++g) {
    const RowGroup& group = robots.model.group[g];
    if (!is_in_pack(robots, rows, group)) continue;
    const auto has = lanes_with(robots, rows, group);
    robots.work.rank[g] = select(has, count, Real(-1));
    count = select(has, count + Real(1), count);
    if (any(count > Real(static_cast<Scalar<Real>>(most)))) ++most;
  }
  return most;
}

/// The rows that some lane has, as slots of a pack. All lanes have the same ones; a lane without the class holds
/// numbers of no row. `groups_of`: how many groups each class has here (classes).
template <class Types>
STICTION_HD SlotCounts list_slots(const RobotsOf<Types>& robots, SlotOf<Types>* slots, SmallOf<Types>* columns,
                                  Index* groups_of) {
  const auto& model = robots.model;
  SlotCounts counts;
  for (Index c = 0; c < model.classes; ++c) {
    const RowClass& rows = model.row_class[c];
    groups_of[c] = rank_groups(robots, rows);
    if (groups_of[c] == 0) continue;
    SmallOf<Types>* const dof = columns;
    columns += 2 * rows.column_count;
    for (Index k = 0; k < rows.column_count; ++k) dof[k] = static_cast<SmallOf<Types>>(model.column[rows.columns + k]);
    for (Index k = 0; k < groups_of[c] * rows.cones; ++k) {
      SlotOf<Types>& slot = slots[counts.slots];
      slot.dofs = rows.dofs;
      slot.rows = rows.rows;
      slot.columns = rows.column_count;
      slot.dof = dof;
      slot.take_place(counts);
    }
  }
  return counts;
}

/// f(group, lanes) of the groups that lanes have as their number `rank` in a class.
template <class Real, int kStride, class F>
STICTION_HD void for_each_of_rank(const Robots<Real, kStride>& robots, const RowClass& rows, Index rank, F&& f) {
  const Real own(static_cast<Scalar<Real>>(rank));
  for (Index g = rows.begin; g < rows.end; ++g) {
    if (!is_in_pack(robots, rows, robots.model.group[g])) continue;
    const auto where = robots.work.rank[g] == own;
    if (any(where)) f(robots.model.group[g], where);
  }
}

}  // namespace stiction::inline STICTION_ISA
