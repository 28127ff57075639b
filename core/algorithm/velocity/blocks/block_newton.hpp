#pragma once

#include "core/algorithm/velocity/blocks/block_renewal.hpp"
#include "core/algorithm/velocity/blocks/block_sweeps.hpp"
#include "core/algorithm/velocity/blocks/evaluate_blocks.hpp"

/// Newton's method in velocities for one environment of many degrees of freedom, by a team
/// (docs/math/velocity_newton.md, "In blocks"). Its linear systems are solved by methods of gradients.
namespace stiction::inline STICTION_ISA {

template <Team TeamT, class Real>
class BlockNewton {
 public:
  /// Steps of a method of gradients in one linear system, at most; what they leave is still a direction of descent.
  static constexpr Index kMostGradientSteps = 1000;
  /// Part of its first residual to which a linear system is solved at least: a step's, and that of a renewal.
  static constexpr double kStepPart = 0.1, kRenewalPart = 1e-4;
  /// Part of the slope at the beginning of a line that may be left where it ends.
  static constexpr double kSlopeLeft = 0.1;
  /// Weight of the proximal term over A's diagonal at the beginning, its factor whenever the problem with it is solved,
  /// and its least. Below, rounding over the weight would be more than the proximal term still hides.
  static constexpr double kFirstWeight = 1e-2, kWeightFall = 0.1, kLeastWeight = 1e-7;
  /// Part of the answer's residual that a problem may leave before the next one.
  static constexpr double kInnerPart = 0.1;
  /// Steps without a better answer after which there is none to come; steps in all, without and with Coulomb's law.
  static constexpr Index kPatience = 100, kMostConvexSteps = 500, kMostCoulombSteps = 200;
  /// Sweeps before the first step of a sequence of problems, of which a residual is evaluated every kSweepChunk. Under
  /// Coulomb's law they also go on wherever a problem has taken kLongProblem steps or has led away. Each time they are
  /// twice as many, up to kMostSweeps.
  static constexpr Index kFirstSweeps = 48, kSweepChunk = 16, kMostSweeps = 3072, kLongProblem = 12;

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
    if (progress_.tolerance > 0.0 && load()) solve();
    return progress_.result();
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
    return find_scale() && set_first_weight();
  }

  /// Diagonals of A and b. Whether all can be computed with.
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

  /// Compliances with the weight `least`; whether any of them needs it.
  STICTION_HD bool set_weights(double least) {
    least_ = least;
    std::uint32_t is_missing = 0;
    for_each(team_, terms_.cones().cones, [&](Index c) {
      if (set_compliances(terms_, c, least)) is_missing = 1;
    });
    return team_.combine(is_missing) != 0;
  }

  /// Where compliance is enough there is no proximal term.
  STICTION_HD_OUTLINE bool set_first_weight() {
    std::uint32_t slips = 0;
    for_each(team_, terms_.cones().cones, [&](Index c) {
      if (job_.law == Law::coulomb && terms_.cones().rows(c) > 1) slips = 1;
    });
    has_slip_ = team_.combine(slips) != 0;
    const bool is_missing = set_weights(kLeastCompliance);
    least_weight_ = is_missing ? kLeastWeight : kLeastCompliance;
    progress_.has_outer = has_slip_ || is_missing;
    if (progress_.has_outer) set_weights(kFirstWeight);
    return true;
  }

  STICTION_HD_OUTLINE void solve() {
    if (start()) return;
    const bool can_sweep = progress_.has_outer && sweeping_.find(team_);
    if (can_sweep && sweep()) return;
    Index since_best = 0;
    while (progress_.steps < progress_.max_iterations && since_best < kPatience) {
      const bool is_exhausted = !step();
      ++progress_.steps;
      const double before = progress_.best;
      const double inner = judge();
      if (progress_.is_answered || !finite_(progress_.residual)) return;
      since_best = progress_.best < before ? 0 : since_best + 1;
      const bool is_met = is_exhausted || inner <= kInnerPart * progress_.residual;
      if (is_exhausted && !progress_.has_outer) return;
      if (can_sweep && has_slip_ && (++problem_steps_ >= kLongProblem || (is_met && progress_.residual > renewed_))) {
        if (sweep()) return;
      } else if (progress_.has_outer && is_met) {
        renewed_ = progress_.residual;
        renew();
        ++progress_.steps;
      }
    }
  }

  /// Sweeps from the best reactions, and a first problem there. Whether an answer was found.
  STICTION_HD_OUTLINE bool sweep() {
    for_each(team_, env_.rows, [&](Index row) { n_.x[row] = n_.best[row]; });
    judge_.push(team_, n_.x);
    BlockSweeps::Momentum momentum = sweeping_.start(team_);
    for (Index k = 0; k < sweeps_; k += kSweepChunk) {
      sweeping_.run(team_, kSweepChunk, momentum);
      judge();
      if (progress_.is_answered) return true;
      // The velocities are those of the reactions that were judged.
      for_each(team_, env_.rows, [&](Index row) { n_.x[row] = n_.answer[row]; });
    }
    sweeps_ = sweeps_ < kMostSweeps ? 2 * sweeps_ : sweeps_;
    set_weights(kFirstWeight);
    start_at_best();
    return false;
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
        n_.held[row] = n_.best[row];
        n_.shift[row] = 0.0 - n_.prox[row] * n_.held[row];
        const double w = n_.mu[row] * fma_(n_.R[row], n_.best[row], images[k] + n_.b[row]);
        if (k > 0) slip = fma_(w, w, slip);
      }
      if (has_slip_) n_.shift[first] = n_.shift[first] + sqrt_(slip);
    });
    first_energy_ = 0.0;
    problem_steps_ = 0;
    renewed_ = __builtin_huge_val();
    refresh();
  }

  /// The next problem of the sequence, and a step on it.
  STICTION_HD_OUTLINE void renew() {
    first_energy_ = 0.0;
    problem_steps_ = 0;
    least_ = max_(kWeightFall * least_, least_weight_);
    const BlockRenewal renewal{terms_, least_, has_slip_, has_slip_};
    for_each(team_, terms_.cones().cones, [&](Index c) { renewal.change_cone(c); });
    terms_.refresh_force(team_, mass_);
    terms_.refresh_hessian(team_, mass_, H_);
    const IncompleteCholesky preconditioner{lists_.levels.view, n_.lower};
    preconditioner.prepare(team_, H_);
    const KrylovProblem problem = system(kRenewalPart);
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

  [[nodiscard]] STICTION_HD KrylovProblem system(double tolerance) const {
    return {terms_.unknowns(), n_.force, n_.step, n_.gradients, tolerance, kMostGradientSteps};
  }

  /// The first point: no change of v_free, or what the warm start says if the function (3) is not larger there. Whether
  /// that is the answer.
  STICTION_HD_OUTLINE bool start() {
    const bool by_reactions =
        job_.warm_start != nullptr && (progress_.has_outer || job_.warm_velocity == nullptr) && load_reactions();
    refresh();
    judge();
    if (by_reactions && !progress_.is_answered) {
      for_each(team_, env_.rows, [&](Index row) { n_.x[row] = n_.held[row]; });
      judge();
    }
    if (progress_.is_answered) return true;
    const bool by_velocity = !by_reactions && job_.warm_velocity != nullptr && has_finite_velocity();
    if (!by_reactions && !by_velocity) return false;
    refresh();
    const double without = terms_.value(team_, mass_);
    if (by_reactions) judge_.push(team_, n_.held);
    for_each(team_, lists_.dofs.count, [&](Index block) {
      for (Index i = 0; i < lists_.dofs.size(block); ++i) {
        const Offset at = static_cast<Offset>(block) * kBodyBlock + i;
        n_.point[at] = by_reactions ? n_.pushed[at] : first_velocity(lists_.dofs.first_dof[block] + i) - n_.v_free[at];
      }
    });
    refresh();
    judge();
    if (progress_.is_answered || terms_.value(team_, mass_) <= without) return progress_.is_answered;
    for_each(team_, terms_.unknowns(), [&](Index i) { n_.point[i] = 0.0; });
    refresh();
    return false;
  }

  /// The warm start's reactions as the centre, if they are finite.
  STICTION_HD_OUTLINE bool load_reactions() {
    std::uint32_t broken = 0;
    for_each(team_, env_.rows, [&](Index row) {
      n_.held[row] = static_cast<double>(job_.warm_start[env_.first_row + row]);
      if (!finite_(n_.held[row])) broken = 1;
    });
    const bool is_finite = team_.combine(broken) == 0;
    for_each(team_, env_.rows, [&](Index row) {
      if (!is_finite) n_.held[row] = 0.0;
      n_.shift[row] = 0.0 - n_.prox[row] * n_.held[row];
    });
    if (!is_finite) progress_.flags |= kFlagWarmStartRejected;
    return is_finite;
  }
  [[nodiscard]] STICTION_HD double first_velocity(Index dof) const {
    return static_cast<double>(job_.warm_velocity[job_.batch.env_dof_offsets[env_.env] + dof]);
  }
  [[nodiscard]] STICTION_HD_OUTLINE bool has_finite_velocity() {
    std::uint32_t broken = 0;
    for_each(team_, env_.dofs, [&](Index dof) {
      if (!finite_(first_velocity(dof))) broken = 1;
    });
    const bool is_finite = team_.combine(broken) == 0;
    if (!is_finite) progress_.flags |= kFlagWarmStartRejected;
    return is_finite;
  }

  /// Motion, reactions and force at the point.
  STICTION_HD void refresh() {
    terms_.refresh_motion(team_);
    terms_.refresh_reactions(team_);
    terms_.refresh_force(team_, mass_);
  }

  /// Force times what it would do to degrees of freedom one by one.
  [[nodiscard]] STICTION_HD double force_energy() {
    return sum_leaves<double>(team_, [&](Index leaf) {
      double sum = 0.0;
      for (Index i = leaf; i < terms_.unknowns(); i += kReduceLeaves)
        sum = fma_(n_.force[i] * n_.force[i], n_.mobility[i], sum);
      return sum;
    });
  }

  /// One step. Whether the function falls along it by more than rounding.
  STICTION_HD_OUTLINE bool step() {
    const double energy = force_energy();
    first_energy_ = max_(energy, first_energy_);
    if (!(energy > 0.0)) return false;
    terms_.refresh_hessian(team_, mass_, H_);
    const IncompleteCholesky preconditioner{lists_.levels.view, n_.lower};
    preconditioner.prepare(team_, H_);
    const double part = min_(kStepPart, 0.5 * sqrt_(sqrt_(div_(energy, first_energy_))));
    conjugate_gradient(team_, H_, system(part), preconditioner);
    const BlockTerms::Along along = terms_.look_along(team_, mass_);
    if (!(along.slope < 0.0 - along.noise)) return false;
    const auto look = [&](double t) { return terms_.look_at(team_, along, t); };
    terms_.take_step(team_, search_line(look, along.slope, kSlopeLeft, along.noise));
    terms_.refresh_reactions(team_);
    terms_.refresh_force(team_, mass_);
    return true;
  }

  /// The residual of the reactions, which are written if it is small enough. Returns what the problem has left.
  STICTION_HD_OUTLINE double judge() {
    for_each(team_, env_.rows,
             [&](Index row) { n_.answer[row] = static_cast<double>(canonical_zero(saturated<Real>(n_.x[row]))); });
    const BlockResidual evaluated = judge_.evaluate(team_);
    progress_.template take<Real>(evaluated.found);
    if (progress_.residual < progress_.best || !has_best_) {
      progress_.best = progress_.residual;
      has_best_ = true;
      for_each(team_, env_.rows, [&](Index row) { n_.best[row] = n_.answer[row]; });
    }
    if (progress_.is_answered) write();
    return evaluated.inner;
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
  double least_ = 0.0, least_weight_ = 0.0;  ///< weight of the proximal term, and where it goes
  double first_energy_ = 0.0;                ///< largest of this problem
  double renewed_ = __builtin_huge_val();    ///< residual at the last renewal
  Index problem_steps_ = 0;                  ///< since then
  Index sweeps_ = kFirstSweeps;              ///< that are next
  bool has_slip_ = false;                    ///< Coulomb's law, and cones that it is for
  bool has_best_ = false;
};

/// What a team takes of an environment.
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
