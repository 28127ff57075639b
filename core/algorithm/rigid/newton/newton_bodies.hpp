#pragma once

#include "core/algorithm/newton/outer_loop.hpp"
#include "core/algorithm/rigid/newton/follow_renewal.hpp"
#include "core/algorithm/rigid/newton/load_space.hpp"
#include "core/algorithm/rigid/sequential_impulses.hpp"

/// Newton's method on the velocities of bodies (docs/math/body_newton.md): the convex law with compliance is a smooth
/// convex function of them. A proximal term stands in for missing compliance. Coulomb's law is the fixed point in
/// which the motion of every contact is shifted by mu times its own sliding.
namespace stiction::inline STICTION_ISA {

/// Takes one Newton step from workspace.point, whose reactions and descent are there. Its linear system is solved to
/// the sequence's tolerance. Returns false if the function falls by no more than rounding.
template <Team TeamT>
STICTION_HD_OUTLINE bool take_newton_step(TeamT& team, const SpaceWorkspace& workspace, const BodySpaceOptions& space,
                                          double compliance, NewtonSequence& sequence) {
  const Index n = workspace.bodies * kBodyBlock;
  const double energy = dot_product(team, n, workspace.descent, workspace.force);
  const double tolerance = sequence.step_tolerance(energy);
  assemble_curvature(team, workspace, compliance);
  solve_space(team, workspace, space, SpaceSystem::symmetric, tolerance);
  for_each(team, workspace.contacts,
           [&](Index p) { relative_motion(workspace.contact[p], workspace.step, workspace.contact[p].along); });
  const double noise = slope_noise(team, workspace, compliance);
  // The slope at the beginning is that of the system that was solved. Hence d'Hd > 0 even if rounding or a direction
  // that nothing can move keeps M and the inverse masses from being each other's inverse.
  const double slope = 0.0 - dot_product(team, n, workspace.force, workspace.step);
  const LinePoint contacts = evaluate_along(team, workspace, LinePoint{0.0, 0.0}, compliance, 0.0);
  const LinePoint bodies{slope - contacts.slope, body_curvature(team, workspace)};
  const bool falls = slope < 0.0 - noise;
  const double alpha = falls ? search_along(team, workspace, bodies, compliance, slope, noise) : 1.0;
  for_each(team, n, [&](Index i) { workspace.point[i] = follow_line(workspace.point[i], workspace.step[i], alpha); });
  for_each(team, workspace.contacts, [&](Index p) { follow_line(workspace.contact[p], alpha); });
  return falls;
}

/// One sub-step of an environment as solve_by_newton() has it, from the iterate s.x. The best one is kept in s.best.
template <Team TeamT, class Real, Law kLaw>
struct BodySpace {
  TeamT& team;
  const BodyEnv<Real>& env;
  const BodySystem<Real, kLaw>& s;
  const SiParams& params;
  const BodySpaceOptions& options;
  const SpaceWorkspace& workspace;
  ErrorScale scale;
  double compliance = div_(params.cfm, params.step);
  NewtonSequence sequence{};

  STICTION_HD double start() {
    const double mean = max_over<double>(team, workspace.contacts, [&](Index p) { return workspace.contact[p].mean; });
    sequence.least_weight = compliance >= kEnoughCompliance * mean ? 0.0 : kProxWeightLeast;
    return judge();
  }
  STICTION_HD bool sweeps_first() const { return true; }
  STICTION_HD bool step() { return take_newton_step(team, workspace, options, compliance, sequence); }
  STICTION_HD NewtonResidual evaluate() {
    const double problem = renew_reactions(team, workspace, compliance);
    store_reactions(team, s, workspace);
    return {judge(), problem};
  }
  STICTION_HD bool is_solved() const { return sequence.is_within(params.tolerance, scale.largest); }
  STICTION_HD bool has_sequence() const { return kLaw == Law::coulomb || sequence.prox_weight > 0.0; }
  STICTION_HD bool can_sweep() const { return kLaw == Law::coulomb; }

  /// Sequential impulses find most of which contacts open.
  STICTION_HD_OUTLINE void sweep() {
    take_best();
    refresh_bodies(team, env, s, params);
    SiMomentum<Real> momentum;
    if (params.momentum) start_momentum(team, s);
    for (Index k = 0; k < sequence.sweeps; k += kSiChunk) {
      run_sweeps(team, env, s, params, kSiChunk, momentum);
      judge();
    }
    sequence.double_sweeps();
    take_best();
    start_at_iterate(team, env, s, workspace, compliance);
    sequence.start(kProxWeightStart);
    set_weights();
    renew_space_motion(team, workspace);
    renew_reactions(team, workspace, compliance);
  }
  /// The centre of the proximal term moves to the reactions.
  STICTION_HD_OUTLINE void renew() {
    for_each(team, workspace.contacts, [&](Index p) {
      for (int k = 0; k < 3; ++k) workspace.contact[p].prox_center[k] = workspace.contact[p].reaction[k];
    });
    sequence.fall();
    set_weights();
    follow_renewal(team, workspace, options, compliance, kLaw == Law::coulomb);
    renew_reactions(team, workspace, compliance);
  }

  /// The best iterate becomes s.x.
  STICTION_HD void take_best() {
    for_each_tiled(team, s.contacts, [&](Index p) {
      for (Index k = 0; k < 3; ++k) s.x.at(k, p) = s.best.at(k, p);
    });
  }

 private:
  /// Returns the residual of s.x, which is kept if it is the best.
  STICTION_HD double judge() {
    const double residual = residual_of(team, env, s, s.x, params, scale, false).residual;
    if (sequence.keep(residual)) keep_best(team, s);
    return residual;
  }
  STICTION_HD void set_weights() {
    for_each(team, workspace.contacts,
             [&](Index p) { workspace.contact[p].prox_weight = sequence.prox_weight * workspace.contact[p].mean; });
  }
};

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
  NewtonEnd end = NewtonEnd::solved;
  for (Index step = 0; step < params.substeps; ++step) {
    if (step > 0) enter_substep(team, env, s, params, entry);
    enter_space(team, env, s, params, workspace);
    BodySpace<TeamT, Real, kLaw> body_space{team, env, s, params, space, workspace, entry.scale};
    Index taken = 0;
    end = solve_by_newton(body_space, taken, params.iterations);
    steps += taken;
    if (step + 1 == params.substeps) break;
    body_space.take_best();
    refresh_bodies(team, env, s, params);
    leave_substep(team, env, s, params);
  }
  Verdict verdict = evaluate_bodies(team, env, s, params, entry.scale);
  if (!finite_(verdict.relative)) {
    entry.scale = fall_back(team, env, s, params);
    verdict = evaluate_bodies(team, env, s, params, entry.scale);
  }
  if (verdict.is_infeasible) entry.flags |= kFlagImmovable;
  const EnvCode code = verdict.code(end == NewtonEnd::broken         ? EnvCode::numerical
                                    : end == NewtonEnd::out_of_steps ? EnvCode::max_iterations
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
