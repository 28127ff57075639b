#pragma once

#include "core/algorithm/newton/outer_loop.hpp"
#include "core/algorithm/problem/first_guess.hpp"
#include "core/algorithm/velocity/blocks/block_renewal.hpp"
#include "core/algorithm/velocity/blocks/block_sweeps.hpp"
#include "core/algorithm/velocity/blocks/evaluate_blocks.hpp"

/// Newton's method in velocities for one environment of many degrees of freedom, by a team
/// (docs/math/velocity_newton.md, "In blocks"). Its linear systems are solved by methods of gradients.
namespace stiction::inline STICTION_ISA {

template <Team TeamT, class Real>
class BlockNewton {
 public:
  /// Part of the slope at the beginning of a line that may be left where it ends.
  static constexpr double kSlopeLeft = 0.1;
  /// Steps in all, without and with Coulomb's law; sweeps of which a residual is evaluated.
  static constexpr Index kMostConvexSteps = 500, kMostCoulombSteps = 200, kSweepChunk = 16;

  STICTION_HD BlockNewton(TeamT& team, const VelocityJob<Real>& job, const LaneEnv<Real>& env, BlockLists& lists,
                          const BlockWorkspace& numbers)
      : team_(team),
        job_(job),
        env_(env),
        lists_(lists),
        n_(numbers),
        terms_{lists, n_, env.rows},
        mass_{lists.dofs, n_.mass, n_.factor},
        judge_{terms_, mass_, job.law},
        sweeping_{terms_, mass_, lists.sweeps, job.law} {}

  /// Solves the environment, and writes its numbers if it is solved. Every lane returns the same.
  STICTION_HD_OUTLINE VelocityResult run() {
    progress_.set_limits(job_, env_.env, job_.law == Law::coulomb ? kMostCoulombSteps : kMostConvexSteps);
    // With tolerance 0 every iteration is asked for, and this method would end at rounding.
    if (progress_.tolerance > 0.0 && load()) solve_by_newton(*this, progress_.steps, progress_.max_iterations);
    return progress_.result();
  }

  // Functions that solve_by_newton() calls.
  NewtonSequence sequence{};
  [[nodiscard]] STICTION_HD bool is_solved() const { return progress_.is_answered; }
  [[nodiscard]] STICTION_HD bool has_sequence() const { return progress_.has_outer; }
  [[nodiscard]] STICTION_HD bool sweeps_first() {
    can_sweep_ = progress_.has_outer && sweeping_.find(team_);
    return can_sweep_;
  }
  [[nodiscard]] STICTION_HD bool can_sweep() const { return can_sweep_ && has_slip_; }

  /// The first point: no change of v_free, or the warm start's if the function (3) is not larger there.
  STICTION_HD_OUTLINE double start() {
    const bool by_reactions =
        job_.warm_start != nullptr && (progress_.has_outer || job_.warm_velocity == nullptr) && load_reactions();
    refresh();
    evaluate();
    if (by_reactions && !progress_.is_answered) {
      for_each(team_, env_.rows, [&](Index row) { n_.x[row] = n_.prox_center[row]; });
      evaluate();
    }
    if (is_solved()) return progress_.residual;
    const bool by_velocity = !by_reactions && job_.warm_velocity != nullptr && has_first_velocity();
    if (!by_reactions && !by_velocity) return progress_.residual;
    refresh();
    const double without = terms_.value(team_, mass_);
    if (by_reactions) judge_.push(team_, n_.prox_center);
    for_each(team_, lists_.dofs.count, [&](Index block) {
      for (Index i = 0; i < lists_.dofs.size(block); ++i) {
        const Offset at = static_cast<Offset>(block) * kBodyBlock + i;
        n_.point[at] = by_reactions ? n_.pushed[at] : first_velocity(lists_.dofs.first_dof[block] + i) - n_.v_free[at];
      }
    });
    refresh();
    evaluate();
    if (is_solved() || terms_.value(team_, mass_) <= without) return progress_.residual;
    for_each(team_, terms_.unknowns(), [&](Index i) { n_.point[i] = 0.0; });
    refresh();
    return progress_.residual;
  }

  STICTION_HD_OUTLINE bool step() {
    const double energy = force_energy();
    const double tolerance = sequence.step_tolerance(energy);
    if (!(energy > 0.0)) return false;
    terms_.refresh_hessian(team_, mass_, H_);
    const IncompleteCholesky preconditioner{lists_.levels.view, n_.lower};
    preconditioner.prepare(team_, H_);
    conjugate_gradient(team_, H_, system(tolerance), preconditioner);
    const BlockTerms::Along along = terms_.line_products(team_, mass_);
    if (!(along.slope < 0.0 - along.noise)) return false;
    const auto look = [&](double t) { return terms_.point_on_line(team_, along, t); };
    terms_.take_step(team_, search_line(look, along.slope, kSlopeLeft, along.noise));
    terms_.refresh_reactions(team_);
    terms_.refresh_force(team_, mass_);
    return true;
  }

  /// The reactions are written if their residual is small enough.
  STICTION_HD_OUTLINE NewtonResidual evaluate() {
    for_each(team_, env_.rows,
             [&](Index row) { n_.answer[row] = static_cast<double>(canonical_zero(saturated<Real>(n_.x[row]))); });
    const BlockResidual evaluated = judge_.evaluate(team_);
    progress_.template take<Real>(evaluated.found);
    if (sequence.keep(progress_.residual))
      for_each(team_, env_.rows, [&](Index row) { n_.best[row] = n_.answer[row]; });
    if (progress_.is_answered) write();
    return {progress_.residual, evaluated.inner};
  }
  STICTION_HD_OUTLINE void sweep() {
    for_each(team_, env_.rows, [&](Index row) { n_.x[row] = n_.best[row]; });
    judge_.push(team_, n_.x);
    BlockSweeps::Momentum momentum = sweeping_.start(team_);
    for (Index k = 0; k < sequence.sweeps; k += kSweepChunk) {
      sweeping_.run(team_, kSweepChunk, momentum);
      evaluate();
      if (is_solved()) return;
      // The velocities are those of the reactions that were judged.
      for_each(team_, env_.rows, [&](Index row) { n_.x[row] = n_.answer[row]; });
    }
    sequence.double_sweeps();
    sequence.start(kProxWeightStart);
    set_weights(sequence.prox_weight);
    start_at_best();
  }
  STICTION_HD_OUTLINE void renew() {
    sequence.fall();
    const BlockRenewal renewal{terms_, sequence.prox_weight, has_slip_, has_slip_};
    for_each(team_, terms_.cones().cones, [&](Index c) { renewal.change_cone(c); });
    terms_.refresh_force(team_, mass_);
    terms_.refresh_hessian(team_, mass_, H_);
    const IncompleteCholesky preconditioner{lists_.levels.view, n_.lower};
    preconditioner.prepare(team_, H_);
    const KrylovProblem problem = system(kRenewalTolerance);
    if (renewal.slip_follows) {
      renewal.assemble(team_, mass_, sliding_);
      bicgstab(team_, sliding_, problem, preconditioner);
    } else {
      conjugate_gradient(team_, H_, problem, preconditioner);
    }
    for_each(team_, terms_.cones().cones, [&](Index c) { renewal.follow_cone(c); });
    for_each(team_, terms_.unknowns(), [&](Index i) { n_.point[i] = n_.point[i] + n_.step[i]; });
    terms_.refresh_reactions(team_);
    terms_.refresh_force(team_, mass_);
  }

 private:
  STICTION_HD_OUTLINE bool load() {
    lists_.dofs.find(team_, env_);
    if (!lists_.dofs.fits) return false;
    lists_.touches.find(team_, job_.batch, env_, lists_.dofs);
    if (!lists_.touches.fits) return false;
    lists_.H.find(team_, lists_.dofs, lists_.touches, env_.rows);
    if (!lists_.H.fits) return false;
    lists_.levels.make(team_, lists_.H.pattern, lists_.level_memory);
    H_ = {lists_.H.pattern, n_.H};
    sliding_ = {lists_.H.pattern, n_.sliding};
    if (!load_environment(team_, job_.batch, env_, lists_, n_)) return false;
    if (!mass_.load(team_, env_, job_.batch.mass_form)) return false;
    for_each(team_, lists_.dofs.count, [&](Index block) {
      for (Index i = 0; i < kBodyBlock; ++i) {
        const double root = mass_.factor[mass_.at(block, block) + i * (kBodyBlock + 1)];
        n_.mobility[static_cast<Offset>(block) * kBodyBlock + i] = div_(1.0, root * root);
      }
    });
    if (!find_scale()) return false;
    set_first_weight();
    return true;
  }

  /// Diagonals of A and b. Returns true if all can be computed with.
  STICTION_HD_OUTLINE bool find_scale() {
    double* const path = n_.path + static_cast<Offset>(team_.rank()) * kMostGroupBlocks * kBodyBlock;
    std::uint32_t is_bad = 0;
    for_each(team_, terms_.cones().cones, [&](Index c) {
      find_diagonal(lists_, mass_, n_, c, path);
      if (!set_weight(terms_, c)) is_bad = 1;
    });
    const double largest = max_over<double>(team_, env_.rows, [&](Index row) { return abs_(n_.b[row]); });
    judge_.scale.unit = error_unit(largest);
    judge_.scale.largest = max_(weigh_islands(team_, terms_, mass_, job_.law, judge_.scale.unit), 1e-300);
    progress_.scale = judge_.scale.largest;
    return team_.combine(is_bad) == 0 && finite_(progress_.scale);
  }

  /// Compliances with that weight of the proximal term; returns true if any of them needs it.
  STICTION_HD bool set_weights(double weight) {
    std::uint32_t is_missing = 0;
    for_each(team_, terms_.cones().cones, [&](Index c) {
      if (set_compliances(terms_, c, weight)) is_missing = 1;
    });
    return team_.combine(is_missing) != 0;
  }

  /// If compliance is enough there is no proximal term.
  STICTION_HD_OUTLINE void set_first_weight() {
    std::uint32_t slips = 0;
    for_each(team_, terms_.cones().cones, [&](Index c) {
      if (job_.law == Law::coulomb && terms_.cones().rows(c) > 1) slips = 1;
    });
    has_slip_ = team_.combine(slips) != 0;
    const bool is_missing = set_weights(kLeastCompliance);
    sequence.least_weight = is_missing ? kProxWeightLeast : kLeastCompliance;
    sequence.prox_weight = kLeastCompliance;
    progress_.has_outer = has_slip_ || is_missing;
    if (progress_.has_outer) {
      sequence.start(kProxWeightStart);
      set_weights(sequence.prox_weight);
    }
  }

  /// The point, the centre and the slips that the best reactions lead to.
  STICTION_HD_OUTLINE void start_at_best() {
    judge_.push(team_, n_.best);
    for_each(team_, terms_.unknowns(), [&](Index i) { n_.point[i] = n_.pushed[i]; });
    for_each(team_, terms_.cones().cones, [&](Index c) {
      double images[kMaxConeRows];
      terms_.times_cone(c, n_.point, images);
      const Index first = terms_.cones().row[c];
      double slip = 0.0;
      for (Index k = 0, row = first; row < terms_.cones().row[c + 1]; ++k, ++row) {
        n_.prox_center[row] = n_.best[row];
        n_.shift[row] = 0.0 - n_.prox[row] * n_.prox_center[row];
        const double w = n_.mu[row] * fma_(n_.R[row], n_.best[row], images[k] + n_.b[row]);
        if (k > 0) slip = fma_(w, w, slip);
      }
      if (has_slip_) n_.shift[first] = n_.shift[first] + sqrt_(slip);
    });
    refresh();
  }

  [[nodiscard]] STICTION_HD KrylovProblem system(double tolerance) const {
    return {terms_.unknowns(), n_.force, n_.step, n_.gradients, tolerance, kMostGradientSteps};
  }

  /// The warm start's reactions as the centre, if it can start from them.
  STICTION_HD_OUTLINE bool load_reactions() {
    std::uint32_t broken = 0;
    for_each(team_, env_.rows, [&](Index row) {
      n_.prox_center[row] = static_cast<double>(job_.warm_start[env_.first_row + row]);
      if (!can_start_from(job_.warm_start[env_.first_row + row])) broken = 1;
    });
    const bool can_start = team_.combine(broken) == 0;
    for_each(team_, env_.rows, [&](Index row) {
      if (!can_start) n_.prox_center[row] = 0.0;
      n_.shift[row] = 0.0 - n_.prox[row] * n_.prox_center[row];
    });
    if (!can_start) progress_.flags |= kFlagWarmStartRejected;
    return can_start;
  }
  [[nodiscard]] STICTION_HD double first_velocity(Index dof) const {
    return static_cast<double>(job_.warm_velocity[job_.batch.env_dof_offsets[env_.env] + dof]);
  }
  [[nodiscard]] STICTION_HD_OUTLINE bool has_first_velocity() {
    std::uint32_t broken = 0;
    for_each(team_, env_.dofs, [&](Index dof) {
      if (!can_start_from(first_velocity(dof))) broken = 1;
    });
    const bool can_start = team_.combine(broken) == 0;
    if (!can_start) progress_.flags |= kFlagWarmStartRejected;
    return can_start;
  }

  /// Motion, reactions and force at the point.
  STICTION_HD void refresh() {
    terms_.refresh_motion(team_);
    terms_.refresh_reactions(team_);
    terms_.refresh_force(team_, mass_);
  }

  /// Force times its motion of the degrees of freedom one by one.
  [[nodiscard]] STICTION_HD double force_energy() {
    return sum_leaves<double>(team_, [&](Index leaf) {
      double sum = 0.0;
      for (Index i = leaf; i < terms_.unknowns(); i += kReduceLeaves)
        sum = fma_(n_.force[i] * n_.force[i], n_.mobility[i], sum);
      return sum;
    });
  }

  /// The answer, to where the batch has it.
  STICTION_HD void write() {
    for_each(team_, env_.rows, [&](Index row) {
      job_.to.lambda[env_.first_row + row] = static_cast<Real>(n_.answer[row]);
      if (job_.to.w != nullptr) job_.to.w[env_.first_row + row] = canonical_zero(saturated<Real>(n_.motion[row]));
    });
    if (job_.to.velocity == nullptr) return;
    for_each(team_, env_.dofs, [&](Index dof) {
      const Index at = lists_.dofs.place(dof);
      job_.to.velocity[job_.batch.env_dof_offsets[env_.env] + dof] =
          canonical_zero(saturated<Real>(n_.v_free[at] + n_.pushed[at]));
    });
  }

  TeamT& team_;
  const VelocityJob<Real>& job_;
  const LaneEnv<Real>& env_;
  BlockLists& lists_;
  BlockWorkspace n_;
  BlockTerms terms_;
  MassBlocks mass_;
  BlockJudge judge_;
  BlockSweeps sweeping_;
  BlockMatrix H_, sliding_;
  LaneProgress progress_;
  bool has_slip_ = false;   ///< Coulomb's law, and cones that it is for
  bool can_sweep_ = false;  ///< the environment's cones have sweeps
};

/// Work of a team on an environment.
template <class Real>
STICTION_HD BlockExtent extent_of_blocks(const LaneEnv<Real>& env) {
  return {env.rows, env.cones, env.dofs};
}

/// Solves an environment that takes_blocks(), in memory of BlockLists::integers and BlockWorkspace::doubles of its
/// extent or of a larger one. Every lane returns the same.
template <Team TeamT, class Real>
STICTION_HD_OUTLINE VelocityResult solve_in_blocks(TeamT& team, const VelocityJob<Real>& job, const LaneEnv<Real>& env,
                                                   Index* integers, double* doubles) {
  const BlockExtent extent = extent_of_blocks(env);
  BlockLists lists(extent, integers);
  const BlockWorkspace numbers(extent, doubles);
  return BlockNewton<TeamT, Real>(team, job, env, lists, numbers).run();
}

}  // namespace stiction::inline STICTION_ISA
