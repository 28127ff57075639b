#pragma once

#include "core/algorithm/rigid/evaluate_bodies.hpp"
#include "core/algorithm/sweep/nesterov.hpp"

/// Sequential impulses (docs/math/si.md): projected Gauss-Seidel on the velocities of bodies (Catto 2005; Jourdan,
/// Alart, Jean 1998 for the local step). It has Nesterov's momentum and restart as in npgs, and sub-steps (Macklin et
/// al. 2019).
namespace stiction::inline STICTION_ISA {

/// Sweeps between two checks of the residual; twists are recomputed as often. Part of the numerics epoch.
inline constexpr Index kSiChunk = 16;

/// State of momentum between sweeps. Lanes of a team hold equal copies.
template <class Real>
struct SiMomentum {
  Real theta = Real(1);
  Real progress = static_cast<Real>(__builtin_huge_valf());
};

/// The iterate before the first sweep is the iterate.
template <Team TeamT, class Real, Law kLaw, int kStride>
STICTION_HD void start_momentum(TeamT& team, const BodySystem<Real, kLaw, kStride>& s) {
  for_each_tiled(team, s.contacts, [&](Index p) {
    for (Index k = 0; k < 3; ++k) s.before.at(k, p) = s.x.at(k, p);
  });
  for_each_tiled(team, s.bodies, [&](Index body) { s.set_twist(s.motion_before, body, s.twist(s.motion, body)); });
}

/// Extrapolates along the last change. Twists are affine in impulses, so the same numbers serve both.
template <Team TeamT, class System>
STICTION_HD void extrapolate(TeamT& team, const System& s, typename System::Real beta) {
  using Real = typename System::Real;
  const auto move = [beta](Real& now, Real& before) {
    const Real value = now;
    now = fma_(beta, value - before, value);
    before = value;
  };
  for_each_tiled(team, s.contacts, [&](Index p) {
    for (Index k = 0; k < 3; ++k) move(s.x.at(k, p), s.before.at(k, p));
  });
  for_each_tiled(team, s.bodies, [&](Index body) {
    const auto now = s.twist_row(s.motion, body);
    const auto before = s.twist_row(s.motion_before, body);
    for (Index k = 0; k < 6; ++k) move(now[k], before[k]);
  });
}

/// After a sweep whose largest step was `progress`.
template <class Real>
STICTION_HD void follow(SiMomentum<Real>& momentum, const NesterovStep<Real>& lead, Real progress) {
  momentum.theta = select(progress > momentum.progress, Real(1), lead.next);
  momentum.progress = progress;
}

/// One sweep with momentum.
template <Team TeamT, class Env, class System, class Real>
STICTION_HD void accelerated_sweep(TeamT& team, const Env& env, const System& s, Real omega,
                                   SiMomentum<Real>& momentum) {
  const NesterovStep<Real> lead = nesterov_step(momentum.theta);
  extrapolate(team, s, lead.beta);
  follow(momentum, lead, team.max(sweep_bodies(team, env, s, omega)));
}
/// `env`, `s` and `momentum` are of one system, of a pack, or of two packs that alternate.
template <Team TeamT, class Env, class System, class Momentum>
STICTION_HD void run_sweeps(TeamT& team, const Env& env, const System& s, const SiParams& params, Index count,
                            Momentum& momentum) {
  const auto omega = static_cast<typename System::Real>(params.omega);
  for (Index k = 0; k < count; ++k) {
    if (params.momentum) {
      accelerated_sweep(team, env, s, omega, momentum);
    } else {
      sweep_bodies(team, env, s, omega);
    }
  }
}

/// State of a solve between two chunks of sweeps. Lanes of a team hold equal copies.
template <class Real>
struct SiProgress {
  SiMomentum<Real> momentum;
  ErrorScale scale;                                      ///< of this sub-step
  Real best = static_cast<Real>(__builtin_huge_valf());  ///< smallest residual estimate of the last sub-step [w]
  Real verified = Real(-1);                              ///< that of the iterate that was last judged [w]
  Real estimate = Real(0);                               ///< of the iterate, in the last sub-step [w]
  std::uint32_t flags = 0;
  Index step = 0;  ///< sub-steps that have ended
  Index done = 0;  ///< sweeps of this one
};

/// Only the last sub-step is judged.
STICTION_HD bool is_last_substep(const SiParams& params, Index step) {
  return step + 1 >= params.substeps;
}

/// Sets out with errors on that scale.
template <class Real>
STICTION_HD void set_out(SiProgress<Real>& progress, const ErrorScale& scale) {
  progress.scale = scale;
  progress.momentum = SiMomentum<Real>{};
  progress.done = 0;
}

/// The twists that the first iterate of a sub-step begins with, and its residual.
template <Team TeamT, class Real, Law kLaw, int kStride>
STICTION_HD void evaluate_first(TeamT& team, const BodyEnv<Real>& env, const BodySystem<Real, kLaw, kStride>& s,
                                const SiParams& params, SiProgress<Real>& progress) {
  refresh_bodies(team, env, s, params);
  if (params.momentum) start_momentum(team, s);
  if (is_last_substep(params, progress.step)) progress.estimate = estimate_residual(team, env, s);
}

template <Team TeamT, class Real, Law kLaw, int kStride>
STICTION_HD void enter_substep(TeamT& team, const BodyEnv<Real>& env, const BodySystem<Real, kLaw, kStride>& s,
                               const SiParams& params, SiProgress<Real>& progress) {
  set_out(progress, begin_substep(team, env, s, params));
  evaluate_first(team, env, s, params, progress);
}

/// Ends a sub-step that is not the last. Its impulses are added up, its twists are those the next one begins with, and
/// gaps have changed by the normal velocity.
template <Team TeamT, class Real, Law kLaw, int kStride>
STICTION_HD_OUTLINE void leave_substep(TeamT& team, const BodyEnv<Real>& env, const BodySystem<Real, kLaw, kStride>& s,
                                       const SiParams& params) {
  const Real step = static_cast<Real>(params.step);
  for_each_tiled(team, s.contacts, [&](Index p) {
    const auto visit = visit_of(env, s, p);
    s.depth.at(0, p) = fma_(-step, dot(velocity_at(visit), visit.frame().n), s.depth.at(0, p));
    for (Index k = 0; k < 3; ++k) {
      const Real impulse = k == 0 ? s.x.at(k, p) : s.x.at(k, p) * visit.mu();
      Real& total = env.impulse[3 * static_cast<Offset>(env.contact_order[p]) + k];
      total = total + impulse;
    }
  });
  for_each_tiled(team, s.bodies, [&](Index body) { s.set_twist(s.start, body, s.twist(s.motion, body)); });
}

template <Team TeamT, class Real, Law kLaw, int kStride>
STICTION_HD void keep_best(TeamT& team, const BodySystem<Real, kLaw, kStride>& s) {
  for_each_tiled(team, s.contacts, [&](Index p) {
    for (Index k = 0; k < 3; ++k) s.best.at(k, p) = s.x.at(k, p);
  });
}

/// No reactions in the whole step: the answer that is finite when no iterate was. As if the first sub-step had been the
/// only one.
template <Team TeamT, class Real, Law kLaw, int kStride>
STICTION_HD_OUTLINE ErrorScale fall_back(TeamT& team, const BodyEnv<Real>& env,
                                         const BodySystem<Real, kLaw, kStride>& s, SiParams& params) {
  params.step = params.step * static_cast<double>(params.substeps);
  params.substeps = 1;
  load_masses(team, env, s);
  for_each_tiled(team, s.contacts, [&](Index p) {
    s.depth.at(0, p) = env.depth[env.contact_order[p]];
    for (Index k = 0; k < 3; ++k) s.best.at(k, p) = Real(0);
  });
  clear_impulses(team, env);
  return begin_substep(team, env, s, params);
}

/// Result of polling the iterate of the last sub-step.
struct SiPoll {
  bool broken, ended;
  bool is_asked;  ///< the best iterate may be the answer: its residual is to be computed in double
};

/// Polls the iterate of the last sub-step, and keeps it if it is the best.
template <Team TeamT, class Real, Law kLaw, int kStride>
STICTION_HD SiPoll poll_last_substep(TeamT& team, const BodySystem<Real, kLaw, kStride>& s, const SiParams& params,
                                     SiProgress<Real>& progress) {
  const Real estimate = progress.estimate;
  if (progress.done == 0 || estimate < progress.best) {
    progress.best = estimate;
    keep_best(team, s);
  }
  const bool broken = !finite_(estimate);
  const bool ended = broken || progress.done >= params.iterations;
  const bool has_candidate = (static_cast<double>(progress.best) <= params.tolerance * progress.scale.largest ||
                              static_cast<double>(progress.best) <= params.absolute_tolerance) &&
                             progress.best != progress.verified;
  return {broken, ended, has_candidate || ended};
}

/// Publishes the answer once its verdict is final, or sweeps have run out. The verdict is computed in double from the
/// bits that are returned. Returns true if it was.
template <Team TeamT, class Real, Law kLaw, int kStride>
STICTION_HD bool finalize_bodies(TeamT& team, const BodyEnv<Real>& env, const BodySystem<Real, kLaw, kStride>& s,
                                 SiParams params, SiPoll poll, Verdict verdict, SiProgress<Real>& progress) {
  const Index earlier = (params.substeps - 1) * params.iterations;
  if (poll.ended && !finite_(verdict.relative)) {
    progress.scale = fall_back(team, env, s, params);
    verdict = evaluate_bodies(team, env, s, params, progress.scale);
  }
  progress.verified = progress.best;
  if (!verdict.is_final() && !poll.ended) return false;
  if (verdict.is_infeasible) progress.flags |= kFlagImmovable;
  const EnvCode code = verdict.code(poll.broken ? EnvCode::numerical : EnvCode::max_iterations);
  write_bodies(team, env, s);
  write_body_status(team, env, params, code, progress.flags, earlier + progress.done, verdict.relative,
                    verdict.absolute);
  return true;
}

template <Team TeamT, class Real, Law kLaw, int kStride>
STICTION_HD bool check_last_substep(TeamT& team, const BodyEnv<Real>& env, const BodySystem<Real, kLaw, kStride>& s,
                                    const SiParams& params, SiProgress<Real>& progress) {
  const SiPoll poll = poll_last_substep(team, s, params, progress);
  if (!poll.is_asked) return false;
  return finalize_bodies(team, env, s, params, poll, evaluate_bodies(team, env, s, params, progress.scale), progress);
}

/// Adds to the facts about an environment. Returns true if it can be solved; if not, it is answered.
template <Team TeamT, class Real>
STICTION_HD bool is_sound(TeamT& team, const BodyEnv<Real>& env, const SiParams& params, std::uint32_t flags,
                          SiProgress<Real>& progress) {
  progress.flags |= flags;
  if (can_sweep(progress.flags)) return true;
  reject_bodies(team, env, params, progress.flags);
  return false;
}

/// Looks at an environment's numbers. Returns true if they can be used; if not, it is answered.
template <Team TeamT, class Real>
STICTION_HD bool admit_bodies(TeamT& team, const BodyEnv<Real>& env, const SiParams& params,
                              SiProgress<Real>& progress) {
  clear_impulses(team, env);
  progress = SiProgress<Real>{};
  return is_sound(team, env, params, inspect_bodies(team, env), progress);
}

/// Up to the first sweep. Returns true if there is anything to solve; if not, the environment is answered.
template <Team TeamT, class Real, Law kLaw, int kStride>
STICTION_HD bool start_bodies(TeamT& team, const BodyEnv<Real>& env, const BodySystem<Real, kLaw, kStride>& s,
                              const SiParams& params, SiProgress<Real>& progress) {
  if (!admit_bodies(team, env, params, progress)) return false;
  const std::uint32_t flags = load_bodies(team, env, s, params, is_warm(env, progress.flags));
  if (!is_sound(team, env, params, flags, progress)) return false;
  enter_substep(team, env, s, params, progress);
  return true;
}

/// Goes on to the next sub-step after a fixed number of sweeps. Returns true if it is the last.
template <Team TeamT, class Real, Law kLaw, int kStride>
STICTION_HD bool reach_last_substep(TeamT& team, const BodyEnv<Real>& env, const BodySystem<Real, kLaw, kStride>& s,
                                    const SiParams& params, SiProgress<Real>& progress) {
  while (!is_last_substep(params, progress.step)) {
    if (progress.done < params.iterations) return false;
    leave_substep(team, env, s, params);
    ++progress.step;
    enter_substep(team, env, s, params, progress);
  }
  return true;
}

/// Between two chunks. Returns true if the environment is answered.
template <Team TeamT, class Real, Law kLaw, int kStride>
STICTION_HD bool check_bodies(TeamT& team, const BodyEnv<Real>& env, const BodySystem<Real, kLaw, kStride>& s,
                              const SiParams& params, SiProgress<Real>& progress) {
  return reach_last_substep(team, env, s, params, progress) && check_last_substep(team, env, s, params, progress);
}

/// Sweeps of the next chunk.
template <class Real>
STICTION_HD Index next_chunk(const SiParams& params, const SiProgress<Real>& progress) {
  const Index left = params.iterations - progress.done;
  return left < kSiChunk ? left : kSiChunk;
}

/// One chunk of sweeps.
template <Team TeamT, class Real, Law kLaw, int kStride>
STICTION_HD_OUTLINE void advance_bodies(TeamT& team, const BodyEnv<Real>& env, const BodySystem<Real, kLaw, kStride>& s,
                                        const SiParams& params, SiProgress<Real>& progress) {
  const Index count = next_chunk(params, progress);
  run_sweeps(team, env, s, params, count, progress.momentum);
  refresh_bodies(team, env, s, params);
  if (is_last_substep(params, progress.step)) progress.estimate = estimate_residual(team, env, s);
  progress.done += count;
}

/// One environment from its numbers to its status: run by a GPU block, a CPU core and a team of CPU threads. A single
/// lane takes the same three steps one by one.
template <Team TeamT, class Real, Law kLaw, int kStride>
STICTION_HD void solve_bodies(TeamT& team, const BodyEnv<Real>& env, const BodySystem<Real, kLaw, kStride>& s,
                              const SiParams& params) {
  SiProgress<Real> progress;
  if (!start_bodies(team, env, s, params, progress)) return;
  while (!check_bodies(team, env, s, params, progress)) advance_bodies(team, env, s, params, progress);
}

/// The method as a machine calls it: on one environment of a job, with scratch of BodySystem's sizes.
template <Law kLaw, class Precision>
struct BodySweeps {
  using Real = Precision;
  using System = BodySystem<Real, kLaw>;

  template <Team TeamT>
  static STICTION_HD void solve(TeamT& team, const BodyJob<Real>& job, const BodyEnv<Real>& env, Real* numbers,
                                double* exact) {
    const SiParams params = si_params(job.stepping, job.options);
    solve_bodies(team, env, System(env.kept, env.bodies, params, numbers, exact), params);
  }
};

}  // namespace stiction::inline STICTION_ISA
