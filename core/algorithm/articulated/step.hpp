#pragma once

#include "core/algorithm/articulated/carry_on.hpp"
#include "core/algorithm/articulated/forces.hpp"
#include "core/algorithm/articulated/observe.hpp"
#include "core/algorithm/articulated/probe.hpp"
#include "core/algorithm/articulated/robot_lists.hpp"
#include "core/algorithm/articulated/robot_source.hpp"

/// A step of the robots in the lanes of a vector (docs/howto/robots_in_lanes.md).
namespace stiction::inline STICTION_ISA {

/// Robots of a batch, one in each lane. Lanes without one repeat the last. memory.numbers(lists, counts) makes the
/// workspace of a solve.
template <class Types, class Memory>
class RobotStep {
 public:
  using Real = typename Types::Wide;
  using T = Scalar<Real>;
  using Work = WorkspaceOf<Types>;
  using Reals = typename Work::Reals;
  static constexpr int kLanes = Types::kLanes;

  STICTION_HD RobotStep(const ArticulatedJob<T>& job, const RobotTree& tree, Work& work, RobotLists<Types>& lists,
                        const Memory& memory)
      : job_(job), robots_{job.model, tree, work}, work_(work), lists_(lists), memory_(memory) {}

  /// Takes `count` <= kLanes environments in, with constants of their own, which no step changes.
  STICTION_HD void take(const Offset* envs, Index count) {
    count_ = count;
    for (int l = 0; l < kLanes; ++l) envs_[l] = envs[l < count ? l : count - 1];
    if (job_.varied != nullptr) load_constants();
  }

  /// Makes a step of the environments. `is_last`: of a call, which is observed.
  STICTION_HD_OUTLINE void run(bool is_last) {
    load();
    if (lanes_ == 0) return;
    const bool observes = is_last && job_.observed != nullptr;
    if (job_.is_still) {
      evaluate(observes);
      settle(bits_of_mask(add_nothing(work_.qacc, job_.model.dof_count, Real(0)) == Real(0)), observes, [](int) {});
      return;
    }
    if (job_.model.is_rk4) {
      step_by_rk4(observes);
    } else {
      evaluate(observes);
    }
    for_each_lane([&](int l) { store_row(work_.qacc, job_.model.dof_count, job_.qacc, l); });
    const unsigned definite = job_.model.is_rk4 ? lanes_ : bits_of_mask(step_by_euler(robots_));
    settle(definite & finite_state(), observes, [&](int l) {
      store_row(work_.qpos, job_.model.q_count, job_.qpos, l);
      store_row(work_.qvel, job_.model.dof_count, job_.qvel, l);
      job_.time[envs_[l]] += job_.timestep;
    });
  }

 private:
  /// f(lane) of those with a robot to step.
  template <class F>
  STICTION_HD void for_each_lane(F&& f) const {
    for (int l = 0; l < kLanes; ++l)
      if ((lanes_ >> l & 1U) != 0) f(l);
  }

  /// Rows of an array by environment into lanes.
  STICTION_HD void load_rows(const T* rows, Index width, const Reals& to) const {
    const auto numbers = to.numbers();
    for (int l = 0; l < kLanes; ++l) {
      const T* const row = rows + envs_[l] * width;
      for (Index k = 0; k < width; ++k) numbers.at(k, l) = row[k];
    }
  }
  STICTION_HD void store_row(const Reals& from, Index width, T* rows, int l) const {
    const auto numbers = from.numbers();
    for (Index k = 0; k < width; ++k) rows[envs_[l] * width + k] = canonical_zero(numbers.at(k, l));
  }

  /// Adds zero times every number of an array: what is not finite makes NaN of it.
  static STICTION_HD Real add_nothing(const Reals& numbers, Index count, Real sum) {
    for (Index k = 0; k < count; ++k) sum = fma_(numbers[k], Real(0), sum);
    return sum;
  }
  [[nodiscard]] STICTION_HD unsigned finite_state() const {
    const ArticulatedModelView<T>& model = job_.model;
    const Real sum = add_nothing(work_.qvel, model.dof_count, add_nothing(work_.qpos, model.q_count, Real(0)));
    return bits_of_mask(sum == Real(0));
  }
  static STICTION_HD unsigned bits_of_mask(Mask<Real> mask) {
    if constexpr (kLanes == 1) {
      return mask ? 1U : 0U;
    } else {
      return lane_bits(mask);
    }
  }

  STICTION_HD void load_constants() {
    for (std::size_t k = 0; k < kVariedArrays; ++k) {
      if (work_.varied[k].data == nullptr) continue;
      const auto which = static_cast<VariedArray>(k);
      const Index width = job_.model.varied_width[k];
      load_rows(job_.varied[k], width, work_.varied[k]);
      const unsigned sound = bits_of_mask(are_in_range(work_.varied[k], width, which));
      for (int l = 0; l < kLanes; ++l)
        if ((sound >> l & 1U) == 0) constant_flags_[l] |= flag_of(which);
    }
    if (work_.subtree_mass.data != nullptr) find_subtree_masses(robots_);
  }
  STICTION_HD void load() {
    const ArticulatedModelView<T>& model = job_.model;
    load_rows(job_.qpos, model.q_count, work_.qpos);
    load_rows(job_.qvel, model.dof_count, work_.qvel);
    load_rows(job_.ctrl, model.actuator_count, work_.ctrl);
    load_rows(job_.qfrc_applied, model.dof_count, work_.applied);
    load_rows(job_.qacc, model.dof_count, work_.start);
    const Real sum =
        add_nothing(work_.applied, model.dof_count, add_nothing(work_.ctrl, model.actuator_count, Real(0)));
    const unsigned finite = finite_state() & bits_of_mask(sum == Real(0));
    unsigned sound = 0;
    lanes_ = 0;
    for (int l = 0; l < kLanes; ++l) {
      records_[l] = RobotRecord{};
      const bool is_active = l < count_ && (job_.active == nullptr || job_.active[envs_[l]] != 0);
      if (is_active) lanes_ |= 1U << l;
      if (constant_flags_[l] == 0) sound |= finite & 1U << l;
    }
    // A robot that is refused has its record, and its neighbours go on.
    for_each_lane([&](int l) {
      if ((sound >> l & 1U) != 0) return;
      fail(l, EnvCode::invalid_input, constant_flags_[l] | ((finite >> l & 1U) == 0 ? kFlagNonFiniteInput : 0U));
      write_record(l);
    });
    lanes_ &= sound;
  }

  STICTION_HD void fail(int l, EnvCode code, std::uint32_t flags) {
    records_[l] = {0.0, 0.0, records_[l].flags | flags, 0, code};
  }
  STICTION_HD void write_record(int l) const {
    const RobotRecord& record = records_[l];
    job_.status[envs_[l]] = EnvStatus{record.relative, record.absolute,
                                      record.flags,    record.steps,
                                      record.code,     SolverKind::velocity_newton,
                                      {0, 0},          0};
  }

  /// Accelerations at the present state, in `qacc`, and what is observed of them.
  STICTION_HD_OUTLINE void evaluate(bool observes) {
    place_bodies(robots_);
    find_inertias(robots_);
    find_mass_matrix(robots_);
    find_bias(robots_);
    const unsigned definite = bits_of_mask(find_smooth_acceleration(robots_));
    for_each_lane([&](int l) {
      if ((definite >> l & 1U) == 0) fail(l, EnvCode::invalid_input, kFlagBadMass);
    });
    const unsigned full = find_points(robots_);
    for_each_lane([&](int l) {
      if ((full >> l & 1U) != 0) records_[l].flags |= kFlagContactsDropped;
    });
    find_limits(robots_);
    solve(lanes_ & definite, observes);
    if (observes) BodyObserver<Real, Types::kStride>{robots_}.write();
  }

  STICTION_HD_OUTLINE void solve(unsigned lanes, bool observes) {
    const ArticulatedModelView<T>& model = job_.model;
    for (Index k = 0; k < model.dof_count; ++k) work_.qacc[k] = canonical_zero(work_.qacc_smooth[k]);
    auto* const slots = lists_.slots;
    Index* const groups_of = lists_.groups_of;
    const SlotCounts counts = list_slots<Types>(robots_, slots, lists_.columns, groups_of);
    if (job_.touched != nullptr) note_touches();
    const ContactForces<Types> forces{robots_, slots, groups_of};
    if (counts.slots == 0 || lanes == 0) {
      if (observes) forces.add_all(false);
      probe(nullptr, slots, groups_of);
      return;
    }
    const Index kept_rows = observes ? counts.rows : 0;
    for (Index row = 0; row < kept_rows; ++row) work_.reaction[row] = Real(0);
    lists_.tree = &robots_.tree;
    if (!keeps_tree<Types>(robots_.tree, slots, counts.slots)) {
      couple_robot(model, lists_.coupled);
      SerialTeam alone;
      build_tree(alone, *lists_.own_tree, model.dof_count, lists_.coupled, slots, counts.slots);
      lists_.tree = lists_.own_tree;
    }
    const VelocityWorkspace<Types> workspace = memory_.numbers(lists_, counts);
    const RobotSource<Types> source{robots_, groups_of, job_.tolerance, job_.max_iterations,
                                    lanes,   kept_rows, records_};
    VelocityNewton<Types, RobotSource<Types>>(source, *lists_.tree, slots, counts, workspace).run();
    if (observes) forces.add_all(true);
    probe(&workspace, slots, groups_of);
  }

  STICTION_HD void probe(const VelocityWorkspace<Types>* workspace, const SlotOf<Types>* slots,
                         const Index* groups_of) const {
    if (job_.probe == nullptr) return;
    for_each_lane([&](int l) { probe_robots<Types>(robots_, *job_.probe, envs_[l], l, workspace, slots, groups_of); });
  }

  /// Writes down which rows each robot has: robots that are alike make the next pack.
  STICTION_HD void note_touches() const {
    std::uint64_t touched[kLanes] = {};
    for (Index c = 0; c < job_.model.classes; ++c) {
      const RowClass& rows = job_.model.row_class[c];
      for (Index g = rows.begin; g < rows.end && rows.source >= RowSource::limit; ++g) {
        if (!is_in_pack(robots_, rows, job_.model.group[g])) continue;
        const unsigned has = bits_of_mask(lanes_with(robots_, rows, job_.model.group[g]));
        for (int l = 0; l < kLanes; ++l) touched[l] |= static_cast<std::uint64_t>(has >> l & 1U) << (c & 63);
      }
    }
    for_each_lane([&](int l) { job_.touched[envs_[l]] = touched[l]; });
  }

  STICTION_HD void copy(const Reals& from, Index count, const Reals& to) const {
    for (Index k = 0; k < count; ++k) to[k] = from[k];
  }
  /// Runge and Kutta's method of order 4, with MuJoCo's sums.
  STICTION_HD_OUTLINE void step_by_rk4(bool observes) {
    const Index dofs = job_.model.dof_count;
    const T weight[4] = {T(1) / T(6), T(1) / T(3), T(1) / T(3), T(1) / T(6)};
    const T ahead[4] = {T(0.5), T(0.5), T(1), T(1)};
    copy(work_.qpos, job_.model.q_count, work_.first_qpos);
    copy(work_.qvel, dofs, work_.first_qvel);
    for (Index k = 0; k < dofs; ++k) work_.sum_rate[k] = work_.sum_qacc[k] = Real(0);
    copy(work_.qvel, dofs, work_.rate);
    Real time(0);
    for (int stage = 0; stage < 4; ++stage) {
      const bool is_last = stage == 3;
      evaluate(observes && is_last);
      copy(work_.qacc, dofs, work_.start);
      if (stage > 0) renew_rates(robots_, time);
      for (Index k = 0; k < dofs; ++k) {
        work_.sum_rate[k] = fma_(Real(weight[stage]), work_.rate[k], work_.sum_rate[k]);
        work_.sum_qacc[k] = fma_(Real(weight[stage]), work_.qacc[k], work_.sum_qacc[k]);
      }
      const Reals& acceleration = is_last ? work_.sum_qacc : work_.qacc;
      time = Real(job_.model.step) * Real(ahead[stage]);
      move_coordinates(robots_, work_.first_qpos, is_last ? work_.sum_rate : work_.rate, time, work_.qpos);
      for (Index k = 0; k < dofs; ++k) work_.qvel[k] = fma_(time, acceleration[k], work_.first_qvel[k]);
    }
  }

  /// Writes records, what is observed, and f(lane), which writes a state. An environment whose numbers are not finite
  /// stays where it was, with what was observed of it before.
  template <class F>
  STICTION_HD void settle(unsigned finite, bool observes, F&& f) {
    for_each_lane([&](int l) {
      const bool has_mass = (records_[l].flags & kFlagBadMass) == 0;
      const bool is_finite = (finite >> l & 1U) != 0;
      if (has_mass && !is_finite) fail(l, EnvCode::numerical, 0);
      write_record(l);
      if (!has_mass || !is_finite) return;
      f(l);
      for (std::size_t k = 0; k < kObservedArrays && observes; ++k)
        store_row(work_.observed[k], job_.model.observed_width[k], job_.observed[k], l);
    });
  }

  const ArticulatedJob<T>& job_;
  RobotsOf<Types> robots_;
  Work& work_;
  RobotLists<Types>& lists_;
  const Memory& memory_;
  RobotRecord records_[kLanes];
  Offset envs_[kLanes];
  Index count_ = 0;                            ///< of environments
  unsigned lanes_ = 0;                         ///< with a robot to step
  std::uint32_t constant_flags_[kLanes] = {};  ///< of constants out of range
};

/// Bytes that step_robots() asks its memory for: lists of a pack or of a lane, and numbers of all lanes side by side.
struct RobotBytes {
  Offset lists, numbers;
};
template <class Types, class T>
STICTION_HD RobotBytes bytes_of_robots(const ArticulatedJob<T>& job, const RobotTree& tree) {
  RobotLists<Types> lists;
  WorkspaceOf<Types> work;
  return {lists.place(job.model, nullptr), work.place(job, tree.entries, nullptr, 0)};
}

/// Makes `steps` steps of `count` <= kLanes environments, the last one observed. `memory` has, beside
/// memory.lists(bytes), memory.numbers(lists, counts) for the workspace of a solve and memory.stages(bytes) for all
/// other numbers, of which lane memory.lane has its own. `tree`: of the job's model.
template <class Types, class T, class Memory>
STICTION_HD void step_robots(const ArticulatedJob<T>& job, const RobotTree& tree, const Offset* envs, Index count,
                             Index steps, const Memory& memory) {
  const RobotBytes bytes = bytes_of_robots<Types>(job, tree);
  RobotLists<Types> lists;
  WorkspaceOf<Types> work;
  lists.place(job.model, static_cast<char*>(memory.lists(bytes.lists)));
  work.place(job, tree.entries, static_cast<char*>(memory.stages(bytes.numbers)), memory.lane);
  RobotStep<Types, Memory> step(job, tree, work, lists, memory);
  step.take(envs, count);
  for (Index k = 0; k < steps; ++k) step.run(k + 1 == steps);
}

}  // namespace stiction::inline STICTION_ISA
