#pragma once

#include "core/algorithm/rigid/newton/follow_renewal.hpp"
#include "core/algorithm/rigid/newton/load_space.hpp"
#include "core/algorithm/rigid/sequential_impulses.hpp"

/// Newton's method on the velocities of bodies (docs/math/body_newton.md): the convex law with compliance is a smooth
/// convex function of them. A proximal term stands in for missing compliance. Coulomb's law is the fixed point in
/// which the motion of every contact is shifted by mu times its own sliding.
namespace stiction::inline STICTION_ISA {

/// Sweeps of sequential impulses before the first Newton step of a sub-step, which find most of which contacts open.
/// Under Coulomb's law they also follow whenever the step is of no use.
inline constexpr Index kSpaceSweeps = 48;
/// Each time twice as many as the time before, up to this: sweeps that begin again lose what momentum they had.
inline constexpr Index kMostSpaceSweeps = 3072;
/// Weight of the proximal term over the mean diagonal of a contact's block at the beginning. Then its factor whenever
/// the problem with it is solved. The last is where it ends unless compliance takes its place. Below, rounding over
/// the weight would be more than the proximal term still hides.
inline constexpr double kProxWeightStart = 1e-2;
inline constexpr double kProxWeightFall = 0.1;
inline constexpr double kProxWeightLeast = 1e-7;
/// Compliance over the largest mean diagonal from which no proximal term is needed.
inline constexpr double kEnoughCompliance = 1e-5;
/// Part of the answer's residual that the inner problem may leave before its centre and its shifts move.
inline constexpr double kSpaceInnerPart = 0.1;
/// Newton steps on one inner problem under Coulomb's law before sweeps are thought to bring more.
inline constexpr Index kSpaceInnerSteps = 12;
/// Newton steps without a better iterate after which there is none to come.
inline constexpr Index kSpacePatience = 100;

/// How a sub-step ended.
enum SpaceEnd : int { kSpaceMet, kSpaceStalled, kSpaceBroken, kSpaceOutOfSteps };

/// Where a sub-step stands. Lanes of a team hold equal copies.
struct SpaceProgress {
  ErrorScale scale;
  double tolerance = 0.0;              ///< on the residual over it
  double best = __builtin_huge_val();  ///< smallest residual [w]
  bool has_best = false;
  double prox_weight = 0.0;               ///< weight of the proximal term over a contact's mean diagonal
  double prox_weight_end = 0.0;           ///< where it goes
  double reference = 0.0;                 ///< energy of the first gradient of this inner problem
  Index inner_steps = 0;                  ///< of Newton since the last renewal
  Index sweeps = kSpaceSweeps;            ///< that are next
  double renewed = __builtin_huge_val();  ///< residual at the last renewal
};

/// The residual of s.x, which is kept if it is the best.
template <Team TeamT, class Real, Law kLaw>
STICTION_HD double evaluate_iterate(TeamT& team, const BodyEnv<Real>& env, const BodySystem<Real, kLaw>& s,
                                    const SiParams& params, SpaceProgress& progress) {
  const double residual = residual_of(team, env, s, s.x, params, progress.scale, false).residual;
  if (!progress.has_best || residual < progress.best) {
    progress.best = residual;
    progress.has_best = true;
    keep_best(team, s);
  }
  return residual;
}

STICTION_HD bool is_met(const SpaceProgress& progress) {
  return div_(progress.best, progress.scale.largest) <= progress.tolerance;
}

/// The best iterate becomes s.x.
template <Team TeamT, class Real, Law kLaw>
STICTION_HD void take_best(TeamT& team, const BodySystem<Real, kLaw>& s) {
  for_each_tiled(team, s.contacts, [&](Index p) {
    for (Index k = 0; k < 3; ++k) s.x.at(k, p) = s.best.at(k, p);
  });
}

template <Team TeamT>
STICTION_HD void set_prox_weight(TeamT& team, const SpaceWorkspace& workspace, double weight) {
  for_each(team, workspace.contacts,
           [&](Index p) { workspace.contact[p].prox_weight = weight * workspace.contact[p].mean; });
}

/// The weight of the next inner problem, which nothing is known of yet.
STICTION_HD void fall_weight(SpaceProgress& progress) {
  progress.prox_weight = max_(kProxWeightFall * progress.prox_weight, progress.prox_weight_end);
  if (progress.prox_weight_end == 0.0 && progress.prox_weight < kEnoughCompliance) progress.prox_weight = 0.0;
  progress.reference = 0.0;
  progress.inner_steps = 0;
}

/// Moves the centre of the proximal term to the reactions and makes it weaker.
template <Team TeamT>
STICTION_HD_OUTLINE void update_prox_center(TeamT& team, const SpaceWorkspace& workspace, SpaceProgress& progress) {
  for_each(team, workspace.contacts, [&](Index p) {
    for (int k = 0; k < 3; ++k) workspace.contact[p].prox_center[k] = workspace.contact[p].reaction[k];
  });
  fall_weight(progress);
  set_prox_weight(team, workspace, progress.prox_weight);
}

/// The residual that a linear system may keep, from the energy of the gradient; the largest energy is remembered.
STICTION_HD double linear_tolerance(double energy, SpaceProgress& progress) {
  energy = max_(energy, 0.0);
  progress.reference = max_(energy, progress.reference);
  const double part = progress.reference > 0.0 ? div_(energy, progress.reference) : 1.0;
  return min_(0.1, 0.5 * sqrt_(sqrt_(part)));
}

/// One Newton step from workspace.point, whose reactions and descent are there. Whether there was nothing left to gain
/// but rounding.
template <Team TeamT>
STICTION_HD_OUTLINE bool take_newton_step(TeamT& team, const SpaceWorkspace& workspace, const BodySpaceOptions& space,
                                          double compliance, SpaceProgress& progress) {
  const Index n = workspace.bodies * kBodyBlock;
  const double energy = dot_product(team, n, workspace.descent, workspace.force);
  const double tolerance = linear_tolerance(energy, progress);
  assemble_curvature(team, workspace, compliance);
  solve_space(team, workspace, space, SpaceSystem::symmetric, tolerance);
  for_each(team, workspace.contacts,
           [&](Index p) { relative_motion(workspace.contact[p], workspace.step, workspace.contact[p].along); });
  const double noise = slope_noise(team, workspace, compliance);
  // The slope at the beginning is that of the system that was solved. So d'Hd > 0 even where rounding or a direction
  // that nothing can move keeps M and the inverse masses from being each other's inverse.
  const double slope = 0.0 - dot_product(team, n, workspace.force, workspace.step);
  const LinePoint contacts = evaluate_along(team, workspace, LinePoint{0.0, 0.0}, compliance, 0.0);
  const LinePoint bodies{slope - contacts.slope, body_curvature(team, workspace)};
  const bool is_exhausted = !(slope < 0.0 - noise);
  const double alpha = is_exhausted ? 1.0 : search_along(team, workspace, bodies, compliance, slope, noise);
  for_each(team, n, [&](Index i) { workspace.point[i] = follow_line(workspace.point[i], workspace.step[i], alpha); });
  for_each(team, workspace.contacts, [&](Index p) { follow_line(workspace.contact[p], alpha); });
  return is_exhausted;
}

/// Sweeps from the best iterate, and a first problem there. Returns what renew_reactions does.
template <Team TeamT, class Real, Law kLaw>
STICTION_HD_OUTLINE double sweep_closer(TeamT& team, const BodyEnv<Real>& env, const BodySystem<Real, kLaw>& s,
                                        const SiParams& params, const SpaceWorkspace& workspace,
                                        SpaceProgress& progress) {
  take_best(team, s);
  refresh_bodies(team, env, s, params);
  SiMomentum<Real> momentum;
  if (params.momentum) start_momentum(team, s);
  for (Index k = 0; k < progress.sweeps; k += kSiChunk) {
    run_sweeps(team, env, s, params, kSiChunk, momentum);
    evaluate_iterate(team, env, s, params, progress);
  }
  progress.sweeps = progress.sweeps < kMostSpaceSweeps ? 2 * progress.sweeps : progress.sweeps;
  take_best(team, s);
  const double compliance = div_(params.cfm, params.step);
  start_at_iterate(team, env, s, workspace, compliance);
  progress.prox_weight = kProxWeightStart;
  progress.reference = 0.0;
  progress.renewed = __builtin_huge_val();
  progress.inner_steps = 0;
  set_prox_weight(team, workspace, progress.prox_weight);
  renew_space_motion(team, workspace);
  return renew_reactions(team, workspace, compliance);
}

/// Solves a sub-step from s.x. The best iterate is in s.best; the steps taken are added to `steps`.
template <Team TeamT, class Real, Law kLaw>
STICTION_HD_OUTLINE SpaceEnd solve_substep(TeamT& team, const BodyEnv<Real>& env, const BodySystem<Real, kLaw>& s,
                                           const SiParams& params, const BodySpaceOptions& space,
                                           const SpaceWorkspace& workspace, SpaceProgress& progress, Index& steps) {
  double residual = evaluate_iterate(team, env, s, params, progress);
  if (is_met(progress)) return kSpaceMet;
  if (!finite_(residual)) return kSpaceBroken;
  if (params.iterations == 0) return kSpaceOutOfSteps;
  const double compliance = div_(params.cfm, params.step);
  const double mean = max_over<double>(team, workspace.contacts, [&](Index p) { return workspace.contact[p].mean; });
  progress.prox_weight_end = compliance >= kEnoughCompliance * mean ? 0.0 : kProxWeightLeast;
  double inner = sweep_closer(team, env, s, params, workspace, progress);
  if (is_met(progress)) return kSpaceMet;
  Index since_best = 0;
  for (Index k = 0; k < params.iterations; ++k) {
    const bool is_exhausted = take_newton_step(team, workspace, space, compliance, progress);
    ++steps;
    inner = renew_reactions(team, workspace, compliance);
    store_reactions(team, s, workspace);
    const double before = progress.best;
    residual = evaluate_iterate(team, env, s, params, progress);
    if (is_met(progress)) return kSpaceMet;
    if (!finite_(residual)) return kSpaceBroken;
    since_best = progress.best < before ? 0 : since_best + 1;
    const bool is_renewed = kLaw == Law::coulomb || progress.prox_weight > 0.0;
    if (since_best >= kSpacePatience || (is_exhausted && !is_renewed)) return kSpaceStalled;
    if (k + 1 == params.iterations) break;
    const bool is_long = kLaw == Law::coulomb && ++progress.inner_steps >= kSpaceInnerSteps;
    const bool is_solved = is_exhausted || inner <= kSpaceInnerPart * residual;
    if (kLaw == Law::coulomb && (is_long || (is_solved && residual > progress.renewed))) {
      inner = sweep_closer(team, env, s, params, workspace, progress);
      if (is_met(progress)) return kSpaceMet;
    } else if (is_renewed && is_solved) {
      const bool with_sliding = kLaw == Law::coulomb;
      progress.renewed = residual;
      update_prox_center(team, workspace, progress);
      follow_renewal(team, workspace, space, compliance, with_sliding);
      ++steps;
      ++k;
      inner = renew_reactions(team, workspace, compliance);
    }
  }
  return kSpaceOutOfSteps;
}

/// Between two sub-steps: the best iterate is the one that counts.
template <Team TeamT, class Real, Law kLaw>
STICTION_HD void leave_with_best(TeamT& team, const BodyEnv<Real>& env, const BodySystem<Real, kLaw>& s,
                                 const SiParams& params) {
  take_best(team, s);
  refresh_bodies(team, env, s, params);
  leave_substep(team, env, s, params);
}

/// One environment from its numbers to its status.
template <Team TeamT, class Real, Law kLaw>
STICTION_HD void solve_bodies_newton(TeamT& team, const BodyEnv<Real>& env, const BodySystem<Real, kLaw>& s,
                                     SiParams params, const BodySpaceOptions& space, const SpaceWorkspace& workspace) {
  SiProgress<Real> entry;
  if (!start_bodies(team, env, s, params, entry)) return;
  load_space_bodies(team, env, workspace);
  load_space_contacts(team, env, params, workspace);
  if (space.preconditioner == BodyPreconditioner::multigrid) place_bodies(team, workspace);
  Index steps = 0;
  SpaceEnd end = kSpaceMet;
  SpaceProgress progress;
  for (Index step = 0; step < params.substeps; ++step) {
    if (step > 0) enter_substep(team, env, s, params, entry);
    enter_space(team, env, s, params, workspace);
    progress = SpaceProgress{};
    progress.scale = entry.scale;
    progress.tolerance = params.tolerance;
    end = solve_substep(team, env, s, params, space, workspace, progress, steps);
    if (step + 1 < params.substeps) leave_with_best(team, env, s, params);
  }
  Verdict verdict = evaluate_bodies(team, env, s, params, entry.scale);
  if (!finite_(verdict.relative)) {
    entry.scale = fall_back(team, env, s, params);
    verdict = evaluate_bodies(team, env, s, params, entry.scale);
  }
  if (verdict.is_infeasible) entry.flags |= kFlagImmovable;
  const EnvCode code = verdict.code(end == kSpaceBroken       ? EnvCode::numerical
                                    : end == kSpaceOutOfSteps ? EnvCode::max_iterations
                                                              : EnvCode::stalled);
  write_bodies(team, env, s);
  write_body_status(team, env, params, code, entry.flags, steps, verdict.relative, verdict.absolute);
}

/// The method as a machine calls it: on one environment of a job, with scratch of BodySystem's sizes and, behind
/// `exact`, of newton_doubles'.
template <Law kLaw, class Precision>
struct BodyNewton {
  using Real = Precision;
  using System = BodySystem<Real, kLaw>;

  template <Team TeamT>
  static STICTION_HD void solve(TeamT& team, const BodyJob<Real>& job, const BodyEnv<Real>& env, Real* numbers,
                                double* exact) {
    const SiParams params = si_params(job.stepping, job.options);
    const System system(env.kept, env.bodies, params, numbers, exact);
    const SpaceWorkspace workspace(kLaw, env.kept, env.bodies, env.newton_stream,
                                   exact + System::exact_elements(env.bodies));
    solve_bodies_newton(team, env, system, params, job.options.space, workspace);
  }
};

}  // namespace stiction::inline STICTION_ISA
