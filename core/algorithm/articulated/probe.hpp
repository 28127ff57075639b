#pragma once

#include "core/algorithm/articulated/rows.hpp"

/// Copies of what a step has computed, environment by environment: for tests and for eyes.
namespace stiction::inline STICTION_ISA {

template <class Types>
struct RobotProbe {
  using Wide = typename Types::Wide;
  const RobotsOf<Types>& robots;
  const ArticulatedProbeView& to;
  const VelocityWorkspace<Types>* workspace;
  const SlotOf<Types>* slots;
  const Index* groups_of;
  int lane;
  Offset env;

  [[nodiscard]] STICTION_HD double number(const Wide& value) const {
    return static_cast<double>(number_in(value, lane));
  }
  STICTION_HD void copy(const typename WorkspaceOf<Types>::Reals& from, Index count, double* array) const {
    for (Index k = 0; k < count; ++k) array[env * count + k] = number(from[k]);
  }

  STICTION_HD void copy_forces() const {
    const auto& work = robots.work;
    const Index dofs = robots.model.dof_count;
    copy(work.bias, dofs, to.bias);
    copy(work.passive, dofs, to.passive);
    copy(work.actuator, dofs, to.actuator);
    copy(work.qacc_smooth, dofs, to.qacc_smooth);
    copy(work.qacc, dofs, to.qacc);
    for (Index k = 0; k < dofs; ++k)
      for (Index d = 0; d <= robots.tree.depth[k]; ++d)
        to.M[(env * dofs + k) * dofs + robots.tree.path(k)[d]] = number(work.M[robots.tree.begin[k] + d]);
  }

  STICTION_HD void copy_contact(const RowGroup& group) const {
    const auto& work = robots.work;
    const Offset at = env * to.most_contacts + to.contacts[env]++;
    to.pair[at] = group.pair;
    double* const numbers = to.contact + 7 * at;
    numbers[0] = number(work.distance[group.index]);
    const Vector3<Wide>&p = work.point[group.index], &n = work.normal[group.index];
    const Wide* const from[6] = {&p.x, &p.y, &p.z, &n.x, &n.y, &n.z};
    for (Index k = 0; k < 6; ++k) numbers[1 + k] = number(*from[k]);
  }
  STICTION_HD void copy_slot(const SlotOf<Types>& slot) const {
    const Index dofs = robots.model.dof_count;
    for (Index k = 0; k < slot.rows; ++k) {
      const Offset at = env * to.most_rows + to.rows[env]++;
      for (Index c = 0; c < slot.columns; ++c)
        to.J[at * dofs + slot.dof[c]] =
            static_cast<double>(workspace->J.at(slot.entry + static_cast<Offset>(k) * slot.columns + c, lane));
      to.aref[at] = static_cast<double>(workspace->target.at(slot.row + k, lane));
      to.R[at] = static_cast<double>(workspace->R.at(slot.row + k, lane));
    }
  }

  /// Copies the rows of a lane's contact or limit that begin with slot s.
  STICTION_HD void copy_group(const RowClass& rows, const RowGroup& group, Index s) const {
    if (rows.source == RowSource::contact) copy_contact(group);
    for (Index k = 0; k < rows.cones && workspace != nullptr; ++k) copy_slot(slots[s + k]);
  }

  STICTION_HD void copy_all() const {
    copy_forces();
    to.rows[env] = to.contacts[env] = 0;
    Index s = 0;
    for (Index c = 0; c < robots.model.classes; ++c) {
      const RowClass& rows = robots.model.row_class[c];
      for (Index rank = 0; rank < groups_of[c]; ++rank, s += rows.cones)
        for_each_of_rank(robots, rows, rank, [&](const RowGroup& group, Mask<Wide> where) {
          if (is_set(where, lane)) copy_group(rows, group, s);
        });
    }
  }
};

template <class Types>
STICTION_HD void probe_robots(const RobotsOf<Types>& robots, const ArticulatedProbeView& to, Offset env, int lane,
                              const VelocityWorkspace<Types>* workspace, const SlotOf<Types>* slots,
                              const Index* groups_of) {
  RobotProbe<Types>{robots, to, workspace, slots, groups_of, lane, env}.copy_all();
}

}  // namespace stiction::inline STICTION_ISA
