#pragma once

#include "core/algorithm/articulated/rows.hpp"
#include "core/algorithm/velocity/iterate/velocity_newton.hpp"

namespace stiction::inline STICTION_ISA {

/// Records of the solves of a lane's step, its stages joined.
struct RobotRecord {
  double relative = 0.0, absolute = 0.0;
  std::uint32_t flags = 0;
  Index steps = 0;
  EnvCode code = EnvCode::solved;

  /// Adds a stage: its code, unless one before it was not solved.
  STICTION_HD void join(const LaneProgress& lane) {
    relative = max_(lane.relative, relative);
    absolute = max_(lane.absolute, absolute);
    flags |= lane.flags;
    steps += lane.steps;
    const EnvCode rest = lane.steps < lane.max_iterations ? EnvCode::stalled : EnvCode::max_iterations;
    const EnvCode answered = lane.is_rounding ? EnvCode::rounding : EnvCode::solved;
    const EnvCode now = lane.is_answered ? answered : rest;
    if (code == EnvCode::solved) code = now;
  }
};

/// Robots whose rows, M and free accelerations lie in lanes, as Newton's method in velocities reads them and answers
/// to. Nothing is handed over; BatchSource is that of a batch.
template <class Types>
struct RobotSource {
  using Wide = typename Types::Wide;
  using Number = typename Types::Number;
  const RobotsOf<Types>& robots;
  const Index* groups_of;  ///< of each class
  double tolerance;
  Index max_iterations;
  unsigned lanes;   ///< bit l: the lane has a robot to solve
  Index kept_rows;  ///< of which reactions are written down, 0: of none
  RobotRecord* records;

  [[nodiscard]] STICTION_HD bool has(int l) const { return (lanes >> l & 1U) != 0; }
  [[nodiscard]] STICTION_HD Law law() const { return Law::convex; }
  [[nodiscard]] STICTION_HD MassForm mass_form() const { return MassForm::matrix; }
  [[nodiscard]] STICTION_HD Index dofs(int) const { return robots.model.dof_count; }
  [[nodiscard]] STICTION_HD bool takes_sequence(int) const { return true; }
  [[nodiscard]] STICTION_HD bool is_one_island() const { return robots.model.is_one_tree; }
  STICTION_HD void set_limits(LaneProgress& lane, int) const {
    lane.tolerance = tolerance;
    lane.max_iterations = max_iterations;
  }

  /// f(entry here, entry in the model's tree) of all entries of M, for a pack's tree, which has more.
  template <class F>
  STICTION_HD void for_each_entry(const TreeOf<Types>& tree, F&& f) const {
    for (Index k = 0; k < tree.dofs; ++k) {
      const auto* const path = robots.tree.path(k);
      for (Index d = 0; d <= robots.tree.depth[k]; ++d)
        f(tree.begin[k] + tree.depth[path[d]], robots.tree.begin[k] + d);
    }
  }

  STICTION_HD void load(const VelocityWorkspace<Types>& workspace, const TreeOf<Types>& tree,
                        const SlotOf<Types>* slots, const SlotCounts&) const {
    for (Index e = 0; e < tree.entries; ++e) workspace.M.put(e, Wide(0));
    for_each_entry(tree, [&](Index here, Index there) { workspace.M.put(here, robots.work.M[there]); });
    for (Index k = 0; k < tree.dofs; ++k) workspace.v_free.put(k, robots.work.qacc_smooth[k]);
    RowWriter<Types>{robots, workspace, slots, groups_of}.write();
  }
  /// In double it is there; in single precision M is factored again, in double.
  template <class Part>
  [[nodiscard]] STICTION_HD auto factor_mass(const Part& part) const {
    if constexpr (sizeof(Number) == sizeof(double)) {
      using Double = typename Types::Double;
      const auto factor = part.array(part.workspace.factor), pivot = part.array(part.workspace.pivot);
      for (Index e = 0; e < part.tree.entries; ++e) factor.put(e, Double(0));
      for_each_entry(part.tree, [&](Index here, Index there) { factor.put(here, robots.work.factor[there]); });
      for (Index k = 0; k < part.tree.dofs; ++k) pivot.put(k, robots.work.inverse[k]);
      return Double(0) == Double(0);
    } else {
      return part.factor_mass();
    }
  }

  [[nodiscard]] STICTION_HD bool has_reactions() const { return false; }
  [[nodiscard]] STICTION_HD bool has_velocities() const { return true; }
  STICTION_HD void load_reactions(const SlotOf<Types>&, const typename Types::Numbers&) const {}
  [[nodiscard]] STICTION_HD Number first_velocity(int l, Index k) const { return robots.work.start.numbers().at(k, l); }

  STICTION_HD void write_lane(const VelocityWorkspace<Types>& workspace, const SlotOf<Types>*, const SlotCounts&,
                              int l) const {
    const auto qacc = robots.work.qacc.numbers();
    for (Index k = 0; k < robots.model.dof_count; ++k)
      qacc.at(k, l) = canonical_zero(static_cast<Number>(workspace.velocity[Offset{k} * Types::kStride + l]));
    const auto reaction = robots.work.reaction.numbers();
    for (Index row = 0; row < kept_rows; ++row) reaction.at(row, l) = workspace.x.at(row, l);
  }
  /// Writes down how a lane ended; without an answer its accelerations are those of the last reactions looked at.
  STICTION_HD void finish(const VelocityWorkspace<Types>& workspace, const LaneProgress& lane, int l) const {
    if (!has(l)) return;
    records[l].join(lane);
    if (!lane.is_answered && lane.evaluations > 0) write_lane(workspace, nullptr, {}, l);
  }
};

}  // namespace stiction::inline STICTION_ISA
