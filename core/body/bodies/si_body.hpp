#pragma once

#include "core/body/bodies/judge_bodies.hpp"

/// Sequential impulses (docs/math/si.md): projected Gauss-Seidel on the velocities of bodies (Catto 2005; Jourdan,
/// Alart, Jean 1998 for the local step), with Nesterov's momentum and restart as in npgs, in sub-steps (Macklin et al.
/// 2019).
namespace stiction::inline STICTION_ISA {

/// Sweeps between two looks at the residual; twists are computed afresh as often. Part of the numerics epoch.
inline constexpr Index kSiChunk = 16;

/// What momentum remembers between sweeps. Lanes of a block hold equal copies.
template <class Real>
struct SiMomentum {
  Real theta = Real(1);
  Real progress = static_cast<Real>(__builtin_huge_valf());
};

/// The iterate before the first sweep is the iterate.
template <Block B, class Real, Law kLaw>
STICTION_HD void start_momentum(B& block, const BodySystem<Real, kLaw>& s) {
  share_out(block, s.contacts, [&](Index p) {
    for (Index k = 0; k < 3; ++k) s.before.at(k, p) = s.x.at(k, p);
  });
  share_out(block, s.bodies, [&](Index body) {
    const Offset row = kBodyRow * static_cast<Offset>(body);
    for (Index k = 0; k < 6; ++k) s.motion_before[row + k] = s.motion[row + k];
  });
}

/// Extrapolates along the last change. Twists are affine in impulses, so the same numbers serve both.
template <Block B, class Real, Law kLaw>
STICTION_HD void extrapolate(B& block, const BodySystem<Real, kLaw>& s, Real beta) {
  const auto move = [beta](Real& now, Real& before) {
    const Real value = now;
    now = fma_(beta, value - before, value);
    before = value;
  };
  share_out(block, s.contacts, [&](Index p) {
    for (Index k = 0; k < 3; ++k) move(s.x.at(k, p), s.before.at(k, p));
  });
  share_out(block, s.bodies, [&](Index body) {
    const Offset row = kBodyRow * static_cast<Offset>(body);
    for (Index k = 0; k < 6; ++k) move(s.motion[row + k], s.motion_before[row + k]);
  });
}

/// One sweep with momentum, docs/math/npgs.md (1)-(4).
template <Block B, class Real, Law kLaw>
STICTION_HD void accelerated_sweep(B& block, const BodyEnv<Real>& env, const BodySystem<Real, kLaw>& s, Real omega,
                                   SiMomentum<Real>& momentum) {
  const Real square = momentum.theta * momentum.theta;
  const Real next = Real(0.5) * (sqrt_(fma_(square, square, Real(4) * square)) - square);
  const Real beta = div_(momentum.theta * (Real(1) - momentum.theta), square + next);
  extrapolate(block, s, beta);
  const Real progress = block.max(sweep_bodies(block, env, s, omega));
  momentum.theta = progress > momentum.progress ? Real(1) : next;
  momentum.progress = progress;
}

template <Block B, class Real, Law kLaw>
STICTION_HD_OUTLINE void run_sweeps(B& block, const BodyEnv<Real>& env, const BodySystem<Real, kLaw>& s,
                                    const SiParams& params, Index count, SiMomentum<Real>& momentum) {
  const Real omega = static_cast<Real>(params.omega);
  for (Index k = 0; k < count; ++k) {
    if (params.momentum) {
      accelerated_sweep(block, env, s, omega, momentum);
    } else {
      sweep_bodies(block, env, s, omega);
    }
  }
  refresh_bodies(block, env, s, params);
}

/// A sub-step that is not the last: a fixed number of sweeps; then its impulses are added up, its twists are those the
/// next one begins with, and gaps have changed by the normal velocity.
template <Block B, class Real, Law kLaw>
STICTION_HD_OUTLINE void run_substep(B& block, const BodyEnv<Real>& env, const BodySystem<Real, kLaw>& s,
                                     const SiParams& params) {
  begin_substep(block, env, s, params);
  refresh_bodies(block, env, s, params);
  if (params.momentum) start_momentum(block, s);
  SiMomentum<Real> momentum;
  for (Index done = 0; done < params.iterations; done += kSiChunk) {
    const Index left = params.iterations - done;
    run_sweeps(block, env, s, params, left < kSiChunk ? left : kSiChunk, momentum);
  }
  const Real step = static_cast<Real>(params.step);
  share_out(block, s.contacts, [&](Index p) {
    const Visit<Real> visit = visit_of(env, s, p);
    const Vector3<Real> u = relative_velocity(s.twist(s.motion, slot_of(visit.side_a)), visit.arm_a,
                                              s.twist(s.motion, slot_of(visit.side_b)), visit.arm_b);
    s.depth.at(0, p) = fma_(-step, dot(u, visit.frame.n), s.depth.at(0, p));
    for (Index k = 0; k < 3; ++k) {
      const Real impulse = k == 0 ? s.x.at(k, p) : s.x.at(k, p) * visit.mu;
      Real& total = env.impulse[3 * static_cast<Offset>(env.contact_order[p]) + k];
      total = total + impulse;
    }
  });
  share_out(block, s.bodies, [&](Index body) { s.set_twist(s.start, body, s.twist(s.motion, body)); });
}

template <Block B, class Real, Law kLaw>
STICTION_HD void keep_best(B& block, const BodySystem<Real, kLaw>& s) {
  share_out(block, s.contacts, [&](Index p) {
    for (Index k = 0; k < 3; ++k) s.best.at(k, p) = s.x.at(k, p);
  });
}

/// No reactions in the whole step: the answer that is finite when no iterate was. As if the first sub-step had been the
/// only one.
template <Block B, class Real, Law kLaw>
STICTION_HD_OUTLINE double fall_back(B& block, const BodyEnv<Real>& env, const BodySystem<Real, kLaw>& s,
                                     SiParams& params) {
  params.step = params.step * static_cast<double>(params.substeps);
  params.substeps = 1;
  load_masses(block, env, s);
  share_out(block, s.contacts, [&](Index p) {
    s.depth.at(0, p) = env.depth[env.contact_order[p]];
    for (Index k = 0; k < 3; ++k) s.best.at(k, p) = Real(0);
  });
  clear_impulses(block, env);
  return begin_substep(block, env, s, params);
}

/// The last sub-step: until its residual, computed in double from the bits that are returned, is at most the tolerance,
/// or sweeps run out.
template <Block B, class Real, Law kLaw>
STICTION_HD void finish_step(B& block, const BodyEnv<Real>& env, const BodySystem<Real, kLaw>& s, SiParams params,
                             std::uint32_t flags) {
  const Index earlier = (params.substeps - 1) * params.iterations;
  double scale = max_(begin_substep(block, env, s, params), 1e-300);
  refresh_bodies(block, env, s, params);
  if (params.momentum) start_momentum(block, s);
  SiMomentum<Real> momentum;
  Real best = static_cast<Real>(__builtin_huge_valf());
  Real verified = Real(-1);
  Index done = 0;
  for (;;) {
    const Real estimate = estimate_residual(block, env, s);
    if (done == 0 || estimate < best) {
      best = estimate;
      keep_best(block, s);
    }
    const bool broken = !finite_(estimate);
    const bool ended = broken || done >= params.iterations;
    const bool nominated = static_cast<double>(best) <= params.tolerance * scale && best != verified;
    if (nominated || ended) {
      double absolute = judge_bodies(block, env, s, params);
      if (ended && !finite_(div_(absolute, scale))) {
        scale = max_(fall_back(block, env, s, params), 1e-300);
        absolute = judge_bodies(block, env, s, params);
      }
      const double relative = div_(absolute, scale);
      const bool solved = finite_(relative) && relative <= params.tolerance;
      verified = best;
      if (solved || ended) {
        const EnvCode code = solved ? EnvCode::solved : broken ? EnvCode::numerical : EnvCode::max_iterations;
        publish_bodies(block, env, s);
        write_body_status(block, env, params, code, flags, earlier + done, relative, absolute);
        return;
      }
    }
    const Index left = params.iterations - done;
    const Index count = left < kSiChunk ? left : kSiChunk;
    run_sweeps(block, env, s, params, count, momentum);
    done += count;
  }
}

/// One environment from its numbers to its status: what a GPU thread, a GPU block, a CPU core and a team of CPU threads
/// run.
template <Block B, class Real, Law kLaw>
STICTION_HD void solve_bodies(B& block, const BodyEnv<Real>& env, BodySystem<Real, kLaw>& s, const SiParams& params) {
  clear_impulses(block, env);
  const std::uint32_t flags = load_bodies(block, env, s, params);
  if (!can_sweep(flags)) {
    refuse_bodies(block, env, params, flags);
    return;
  }
  for (Index step = 1; step < params.substeps; ++step) run_substep(block, env, s, params);
  finish_step(block, env, s, params, flags);
}

}  // namespace stiction::inline STICTION_ISA
