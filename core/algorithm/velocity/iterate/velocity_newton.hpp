#pragma once

#include "core/algorithm/newton/outer_loop.hpp"
#include "core/algorithm/problem/first_guess.hpp"
#include "core/algorithm/velocity/evaluate/evaluate_pack.hpp"
#include "core/algorithm/velocity/iterate/newton_step.hpp"
#include "core/algorithm/velocity/iterate/shift_terms.hpp"
#include "core/algorithm/velocity/iterate/warm_guess.hpp"
#include "core/algorithm/velocity/load/batch_source.hpp"

/// Newton's method in velocities for the environments in the lanes of a pack (docs/math/velocity_newton.md). A lane's
/// numbers depend on its environment alone: other lanes only add exact zeros and idle iterations.
namespace stiction::inline STICTION_ISA {

template <class Types, class Source = BatchSource<Types>>
class VelocityNewton {
 public:
  using Wide = typename Types::Wide;
  using Real = typename Types::Real;
  using Number = typename Types::Number;
  using Double = typename Types::Double;
  static constexpr int kLanes = Types::kLanes;
  /// Share of its error to which steps in this precision can take an environment before z is computed in double again.
  static constexpr double kAccurateTo = sizeof(Number) == sizeof(float) ? 1e-4 : 0.0;

  STICTION_HD VelocityNewton(const Source& source, const TreeOf<Types>& tree, const SlotOf<Types>* slots,
                             const SlotCounts& counts, const VelocityWorkspace<Types>& workspace)
      : source_(source),
        slots_(slots),
        counts_(counts),
        tree_(tree),
        workspace_(workspace),
        pack_{workspace_, tree_, slots, counts_} {}

  /// Solves the environments, and writes the numbers of each as soon as it is solved: what its lane holds after that is
  /// of no use.
  STICTION_HD_OUTLINE void run() {
    load();
    while (iterate()) evaluate();
    for (int l = 0; l < kLanes; ++l) source_.finish(workspace_, progress_[l], l);
  }

 private:
  [[nodiscard]] STICTION_HD DoublePack<Types> in_double(int first) const {
    return {workspace_, tree_, slots_, counts_, first, source_.mass_form()};
  }
  [[nodiscard]] STICTION_HD ShiftTerms<Types> shift() const { return {workspace_, slots_, counts_, source_.law()}; }
  /// f(DoublePack) for all lanes.
  template <class F>
  STICTION_HD void for_each_part(F&& f) const {
    for (int first = 0; first < kLanes; first += Types::kDoubleLanes) f(in_double(first));
  }
  /// One number for each lane.
  template <class F>
  static STICTION_HD Wide lanes(F&& f) {
    Number values[kLanes];
    for (int l = 0; l < kLanes; ++l) values[l] = static_cast<Number>(f(l));
    Wide wide;
    load_lanes(values, wide);
    return wide;
  }

  STICTION_HD_OUTLINE void load() {
    source_.load(workspace_, tree_, slots_, counts_);
    const auto sound = sound_lanes(workspace_, tree_, slots_, counts_);
    for (int l = 0; l < kLanes; ++l) {
      LaneProgress& lane = progress_[l];
      lane = LaneProgress{};
      lane.is_busy = source_.has(l) && is_set(sound, l);
      if (!lane.is_busy) continue;
      source_.set_limits(lane, l);
      // With tolerance 0 every iteration is asked for, and this method would end at rounding.
      lane.is_busy = lane.tolerance > 0.0;
    }
    for_each_part([&](const DoublePack<Types>& part) {
      const auto definite = source_.factor_mass(part);
      workspace_.each(tree_.dofs, [&](Index k) { part.put(workspace_.mobility, k, part.array(workspace_.pivot)[k]); });
      part.find_diagonal();
      const Double scale = part.find_scale(source_.law(), source_.is_one_island());
      for (int l = 0; l < Types::kDoubleLanes; ++l) {
        LaneProgress& lane = progress_[part.first + l];
        lane.scale = max_(lane_of(scale, l), 1e-300);
        lane.is_busy = lane.is_busy && is_set(definite, l) && finite_(lane.scale);
      }
    });
    set_laws();
    start();
  }

  /// Compliances of the iteration, and which lanes solve a sequence of problems.
  STICTION_HD_OUTLINE void set_laws() {
    for_each_part([&](const DoublePack<Types>& part) {
      const auto found = part.set_laws();
      for (int l = 0; l < Types::kDoubleLanes; ++l) {
        LaneProgress& lane = progress_[part.first + l];
        // A bad one is flagged kFlagBadDiagonal, or solved as one of its kind is, by what takes A.
        if (is_set(found.bad, l)) lane.is_busy = false;
        lane.has_outer = is_set(found.proximal, l);
      }
    });
    for (int l = 0; l < kLanes; ++l) {
      progress_[l].has_outer = progress_[l].has_outer || (source_.law() == Law::coulomb && has_friction(l));
      if (progress_[l].has_outer && !source_.takes_sequence(l)) progress_[l].is_busy = false;
    }
  }

  [[nodiscard]] STICTION_HD bool has_friction(int l) const {
    for (Index s = 0; s < counts_.slots; ++s)
      for (Index k = 1; k < slots_[s].rows && slots_[s].row_of[l] >= 0; ++k)
        if (workspace_.mu.at(slots_[s].row + k, l) > Number(0)) return true;
    return false;
  }

  /// The warm start's reactions; zeros in lanes that cannot start from one of them.
  STICTION_HD_OUTLINE void load_guess() {
    auto can_start = Wide(0) == Wide(0);
    workspace_.each(counts_.slots, [&](Index s) {
      source_.load_reactions(slots_[s], workspace_.x);
      for (Index k = 0; k < slots_[s].rows; ++k)
        can_start = and_(can_start, can_start_from(workspace_.x[slots_[s].row + k]));
    });
    can_start = workspace_.all(can_start);
    if (!any(not_(can_start))) return;
    workspace_.each(counts_.rows,
                    [&](Index row) { workspace_.x.put(row, select(can_start, workspace_.x[row], Wide(0))); });
    for (int l = 0; l < kLanes; ++l)
      if (!is_set(can_start, l) && !progress_[l].starts_at_velocity) progress_[l].flags |= kFlagWarmStartRejected;
  }

  /// The first velocity: v_free, or what the warm start says. If both velocities and reactions are given, a sequence
  /// of problems starts from reactions, whose shifts velocities do not tell.
  STICTION_HD_OUTLINE void start() {
    bool any_reactions = false, any_velocity = false;
    for (int l = 0; l < kLanes; ++l) {
      LaneProgress& lane = progress_[l];
      lane.goal = max_(lane.has_outer ? kFirstGoal : kAccurateTo, propose(lane));
      lane.starts_at_velocity = source_.has_velocities() && lane.is_busy &&
                                !(lane.has_outer && source_.has_reactions()) && has_first_velocity(l);
      any_reactions = any_reactions || (lane.is_busy && !lane.starts_at_velocity);
      any_velocity = any_velocity || lane.starts_at_velocity;
    }
    if (any_velocity)  // z at v_free, before anything is evaluated
      for_each_part([&](const DoublePack<Types>& part) {
        workspace_.each(counts_.rows, [&](Index row) {
          part.put(workspace_.free_motion(), row, part.array(workspace_.motion)[row]);
        });
      });
    any_reactions = any_reactions && source_.has_reactions();
    if (any_reactions) {
      load_guess();
      for_each_proposal([&](int l, const FinalResidual& found) {
        if (!progress_[l].starts_at_velocity) judge_guess(l, found);
      });
      for (int l = 0; l < kLanes; ++l)
        if (progress_[l].is_busy && progress_[l].has_outer && !progress_[l].starts_at_velocity)
          shift().renew(l, progress_[l]);
      for_each_part([](const DoublePack<Types>& part) { WarmGuess<Types>{part}.aim(); });
    }
    for_each_part([&](const DoublePack<Types>& part) {
      // Without a warm start this is v_free, at which the scale was found.
      workspace_.each(tree_.dofs,
                      [&](Index k) { part.array(workspace_.v).put(k, part.array(workspace_.velocity)[k]); });
    });
    forget_steps();
    if (any_reactions) step_to_guess();
    if (any_velocity) {
      start_at_velocities();
    } else {
      refresh();
    }
  }

  /// v is where the steps so far have led.
  STICTION_HD void forget_steps() const {
    workspace_.each(tree_.dofs, [&](Index k) { workspace_.dv.put(k, Wide(0)); });
  }
  [[nodiscard]] STICTION_HD bool has_first_velocity(int l) {
    bool can_start = true;
    for (Index k = 0; k < source_.dofs(l); ++k) can_start = can_start && can_start_from(source_.first_velocity(l, k));
    if (!can_start) progress_[l].flags |= kFlagWarmStartRejected;
    return can_start;
  }
  /// Goes to the given velocities in lanes that start there, unless the function (3) is smaller at v_free. It can be
  /// far larger after a small change of free motion opens or presses contacts (docs/math/velocity_newton.md).
  STICTION_HD_OUTLINE void start_at_velocities() {
    workspace_.each(counts_.rows, [&](Index row) { workspace_.z.put(row, workspace_.free_motion()[row]); });
    pack_.refresh_reactions();
    const Wide without = pack_.potential();
    for (int l = 0; l < kLanes; ++l)
      workspace_.each(progress_[l].starts_at_velocity ? source_.dofs(l) : 0, [&](Index k) {
        workspace_.v[Offset{k} * Types::kStride + l] = static_cast<double>(source_.first_velocity(l, k));
      });
    for_each_part([](const DoublePack<Types>& part) {
      part.refresh_motion();
      part.write_change();
    });
    forget_steps();
    pack_.refresh_reactions();
    const auto is_smaller = pack_.potential() + pack_.energy() <= without;
    bool any_back = false;
    for (int l = 0; l < kLanes; ++l) {
      if (!progress_[l].starts_at_velocity || is_set(is_smaller, l)) continue;
      any_back = true;
      workspace_.each(counts_.rows, [&](Index row) { workspace_.z.at(row, l) = workspace_.free_motion().at(row, l); });
      workspace_.each(tree_.dofs, [&](Index k) {
        workspace_.v[Offset{k} * Types::kStride + l] = static_cast<double>(workspace_.v_free.at(k, l));
      });
    }
    if (any_back) pack_.refresh_reactions();
    for_each_part([](const DoublePack<Types>& part) { part.refresh_gradient(); });
  }

  /// Steps to the velocity at which M (v - v_free) is J' x. There x is the guess's reactions and what they answer to
  /// the motion that v has beyond theirs. This is one linear system, exact where no cone changes its state.
  STICTION_HD_OUTLINE void step_to_guess() {
    pack_.refresh_reactions();
    pack_.push_back();
    pack_.refresh_hessian();
    auto&& team = workspace_.team();
    factor_tree(team, tree_, workspace_.H, workspace_.inverse);
    workspace_.each(tree_.dofs, [&](Index k) { workspace_.dv.put(k, workspace_.gradient[k]); });
    solve_tree(team, tree_, workspace_.H, workspace_.inverse, workspace_.dv);
    const auto may_step = [&](int l) {
      const LaneProgress& lane = progress_[l];
      return lane.is_busy && !lane.starts_at_velocity && lane.max_iterations > 0;
    };
    const Wide stepping = lanes([&](int l) { return may_step(l) ? 1.0 : 0.0; });
    workspace_.each(tree_.dofs, [&](Index k) {
      const Wide step = workspace_.dv[k];
      workspace_.dv.put(k, select(and_(stepping > Wide(0), finite_(step)), step, Wide(0)));
    });
    for (int l = 0; l < kLanes; ++l)
      if (may_step(l)) ++progress_[l].steps;
  }

  static STICTION_HD double propose(const LaneProgress& lane) { return kProposeAt * lane.tolerance; }

  STICTION_HD_OUTLINE void refresh() {
    for_each_part([](const DoublePack<Types>& part) { part.refresh_motion(); });
    pack_.refresh_reactions();
    for_each_part([](const DoublePack<Types>& part) { part.refresh_gradient(); });
    forget_steps();
  }

  /// Steps without progress before a lane is evaluated. In single precision the gradient that steps add up is rounding
  /// before long. An evaluation tells what it is, and often finds the answer.
  static STICTION_HD double most_idle(const LaneProgress& lane) {
    return sizeof(Number) == sizeof(float) && lane.evaluations > 0 && !lane.has_outer ? kMostIdleOnceEvaluated
                                                                                      : kMostIdle;
  }

  /// Steps until every lane is finished or proposes an answer. Returns true if any proposes one.
  STICTION_HD_OUTLINE bool iterate() {
    const Wide busy = lanes([&](int l) { return progress_[l].is_busy ? 1.0 : 0.0; });
    const Wide enough = lanes([&](int l) { return progress_[l].goal * progress_[l].scale; });
    const Wide most = lanes([&](int l) { return progress_[l].max_iterations; });
    const Wide patience = lanes([&](int l) { return most_idle(progress_[l]); });
    Wide steps = lanes([&](int l) { return progress_[l].steps; });
    Wide least(static_cast<Number>(__builtin_huge_val()));
    Wide idle(0);
    auto moving = busy > Wide(0);
    if (!any(moving)) return false;
    for (;;) {
      Wide error(0);
      Wide nothing(0);
      workspace_.share(tree_.dofs, [&](Index k) {
        const Wide gradient = workspace_.gradient[k];
        error = max_(abs_(gradient) * workspace_.mobility[k], error);
        nothing = fma_(gradient, Wide(0), nothing);
      });
      error = workspace_.largest(error);
      const auto is_finite = workspace_.all(nothing == Wide(0));
      const auto is_better = error < least;
      least = select(is_better, error, least);
      idle = select(is_better, Wide(0), idle + Wide(1));
      moving = and_(moving, and_(and_(error > enough, is_finite), and_(steps < most, idle < patience)));
      if (!any(moving)) break;
      step(moving);
      steps = select(moving, steps + Wide(1), steps);
    }
    Number taken[kLanes];
    store_lanes(taken, steps);
    for (int l = 0; l < kLanes; ++l) progress_[l].steps = static_cast<Index>(taken[l]);
    return true;
  }

  STICTION_HD_OUTLINE void step(Mask<Wide> moving) {
    pack_.refresh_hessian();
    auto&& team = workspace_.team();
    factor_tree(team, tree_, workspace_.H, workspace_.inverse);
    workspace_.each(tree_.dofs, [&](Index k) { workspace_.step.put(k, Wide(0) - workspace_.gradient[k]); });
    solve_tree(team, tree_, workspace_.H, workspace_.inverse, workspace_.step);
    workspace_.each(tree_.dofs, [&](Index k) { workspace_.step.put(k, select(moving, workspace_.step[k], Wide(0))); });
    const Wide descent = pack_.line_products();
    pack_.take_step(pack_.search(moving, descent));
  }

  /// f(lane, FinalResidual) of the reactions in every lane, as the batch's precision has them.
  template <class F>
  STICTION_HD void for_each_proposal(F&& f) const {
    if constexpr (sizeof(Real) < sizeof(Number))
      workspace_.each(counts_.rows, [&](Index row) { workspace_.x.put(row, in_single(workspace_.x[row])); });
    for_each_part([&](const DoublePack<Types>& part) {
      const auto evaluated = part.evaluate(source_.law());
      for (int l = 0; l < Types::kDoubleLanes; ++l)
        f(part.first + l,
          final_residual_of({lane_of(evaluated.square, l), lane_of(evaluated.stuck, l), lane_of(evaluated.plain, l),
                             lane_of(evaluated.size, l), lane_of(evaluated.reaction, l)},
                            {1.0, lane_of(part.array(workspace_.error_unit)[0], l)}));
    });
  }

  /// Residuals of what the lanes propose. Lanes that are not finished go on from there.
  STICTION_HD_OUTLINE void evaluate() {
    for_each_proposal([&](int l, const FinalResidual& found) { judge(l, found); });
    bool any_busy = false;
    for (int l = 0; l < kLanes; ++l) {
      any_busy = any_busy || progress_[l].is_busy;
      if (progress_[l].is_busy && progress_[l].has_outer) shift().renew(l, progress_[l]);
    }
    if (any_busy) refresh();
  }

  /// The relative residual of a lane's reactions, which are written if it is small enough.
  STICTION_HD double accept(int l, const FinalResidual& found) {
    LaneProgress& lane = progress_[l];
    lane.template take<Real>(found);
    lane.is_busy = !lane.is_answered;
    if (lane.is_answered) source_.write_lane(workspace_, slots_, counts_, l);
    return lane.relative;
  }

  STICTION_HD_OUTLINE void judge_guess(int l, const FinalResidual& found) {
    LaneProgress& lane = progress_[l];
    if (!lane.is_busy) return;
    const double relative = accept(l, found);
    if (lane.has_outer && relative < 1.0) lane.goal = max_(kProblemPart * relative, propose(lane));
  }

  STICTION_HD_OUTLINE void judge(int l, const FinalResidual& found) {
    LaneProgress& lane = progress_[l];
    if (!lane.is_busy) return;
    const double relative = accept(l, found);
    const bool has_halved = relative < 0.5 * lane.mark;
    lane.useless = has_halved ? 0 : lane.useless + 1;
    if (has_halved) lane.mark = relative;
    if (relative > 2.0 * lane.best) lane.mixed = 0;
    lane.best = min_(relative, lane.best);
    ++lane.evaluations;
    const int patience = lane.has_outer ? 4 * kMostUseless : kMostUseless;
    lane.is_busy = lane.is_busy && finite_(relative) && lane.steps < lane.max_iterations && lane.useless < patience &&
                   lane.evaluations < kMostEvaluations;
    const double accurate = kAccurateTo * relative;
    lane.goal = lane.has_outer              ? max_(max_(kProblemPart * relative, accurate), propose(lane))
                : lane.goal > propose(lane) ? max_(accurate, propose(lane))
                                            : 0.1 * lane.goal;
  }

  Source source_;
  const SlotOf<Types>* slots_;
  const SlotCounts& counts_;
  const TreeOf<Types>& tree_;
  const VelocityWorkspace<Types>& workspace_;
  NewtonPack<Types> pack_;
  LaneProgress progress_[kLanes];
};

}  // namespace stiction::inline STICTION_ISA
