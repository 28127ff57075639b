#pragma once

#include "core/algorithm/rigid/sequential_impulses.hpp"

/// Sweeps whose lanes wait for no colour (docs/math/si.md, "Without waiting"; Hsieh, Yu, Dhillon 2015; Liu, Wright
/// 2015). They give up bits. Colours pass over what they come to, and an answer is judged as ever.
namespace stiction::inline STICTION_ISA {

/// A team whose lanes need not meet. deal() has f(k) for k = 0 ... count - 1 in order, each done by the next free lane.
/// Item k begins after all up to k - window have ended, and sees their writes. It begins and ends in a sync.
/// Shared<Real, n> is n numbers and a lock behind them: seen(k), change(f) and open().
template <class TeamT>
concept DealingTeam = Team<TeamT> && requires(TeamT& team, void (*f)(Offset)) {
  team.deal(Offset{}, Offset{}, f);
  typename TeamT::template Shared<double, 6>;
};

/// Vertices that a lane takes at a time. Most have some contacts, and a lane takes some microseconds over them.
inline constexpr Index kDealtVertices = 32;

/// A system whose twists lanes read and push at once. A visit reads each number of a twist as some lane left it, and
/// not all six at one moment. Impulses are written by the one lane that visits their contact.
template <class RealType, Law kLawValue, class Shared>
struct ContendedBodies : BodySystem<RealType, kLawValue> {
  using Real = RealType;
  using Single = BodySystem<Real, kLawValue>;
  explicit ContendedBodies(const Single& s) : Single(s) {}

  /// A body's twist, which has room for a lock behind it.
  [[nodiscard]] Shared shared(Index slot) const {
    static_assert(Single::kTwistRow > 6);
    return Shared(this->twist_row(this->motion, slot).data);
  }
  [[nodiscard]] Twist<Real> seen_twist(Index slot) const {
    const Shared row = shared(slot);
    return {{row.seen(0), row.seen(1), row.seen(2)}, {row.seen(3), row.seen(4), row.seen(5)}};
  }
  /// Moves a twist to the pushed one, or as far from its value by others meanwhile.
  void move_side(Index side, bool, const Twist<Real>& was, const Twist<Real>& is) const {
    const Real from[6] = {was.linear.x, was.linear.y, was.linear.z, was.angular.x, was.angular.y, was.angular.z};
    const Real to[6] = {is.linear.x, is.linear.y, is.linear.z, is.angular.x, is.angular.y, is.angular.z};
    shared(side).change([&](int k, Real now) { return now == from[k] ? to[k] : now + (to[k] - from[k]); });
  }
};

template <class Real, Law kLaw, class Shared>
ContactVisit<Real> visit_of(const BodyEnv<Real>& env, const ContendedBodies<Real, kLaw, Shared>& s, Index p) {
  return visit_with(env, s, p, [&](Index slot) { return s.seen_twist(slot); });
}

/// Makes several sweeps in the order of colours without waiting for any. No contact is more than a sweep ahead of
/// another. Returns the largest step of this lane.
template <DealingTeam TeamT, class Real, Law kLaw, class Shared>
Real sweep_dealt(TeamT& team, const BodyEnv<Real>& env, const ContendedBodies<Real, kLaw, Shared>& s, Real omega,
                 Index sweeps) {
  const Index vertices = env.color_offsets[env.color_count];
  const Offset items = (vertices + kDealtVertices - 1) / kDealtVertices;
  Real largest(0);
  team.deal(items * sweeps, items, [&](Offset k) {
    const Index first = static_cast<Index>(k % items) * kDealtVertices;
    const Index end = first + kDealtVertices < vertices ? first + kDealtVertices : vertices;
    largest = max_(visit_vertices(env, s, first, end, omega), largest);
  });
  return largest;
}

/// One sweep of them, in which momentum's own steps are taken by all lanes together.
template <DealingTeam TeamT, class Real, Law kLaw, class Shared>
Real sweep_bodies(TeamT& team, const BodyEnv<Real>& env, const ContendedBodies<Real, kLaw, Shared>& s, Real omega) {
  return sweep_dealt(team, env, s, omega, 1);
}

/// Chunks of asynchronous sweeps until the best iterate looks like the answer, or one chunk is left. x becomes that
/// iterate.
template <DealingTeam TeamT, class Real, Law kLaw>
void sweep_ahead(TeamT& team, const BodyEnv<Real>& env, const BodySystem<Real, kLaw>& s, const SiParams& params,
                 SiProgress<Real>& progress) {
  const ContendedBodies<Real, kLaw, typename TeamT::template Shared<Real, 6>> contended(s);
  for_each_tiled(team, s.bodies, [&](Index body) { contended.shared(body).open(); });
  while (progress.done <= params.iterations - 2 * kSiChunk) {
    if (params.momentum) {
      run_sweeps(team, env, contended, params, kSiChunk, progress.momentum);
    } else {
      sweep_dealt(team, env, contended, static_cast<Real>(params.omega), kSiChunk);
    }
    refresh_bodies(team, env, s, params);
    progress.estimate = estimate_residual(team, env, s);
    progress.done += kSiChunk;
    if (poll_last_substep(team, s, params, progress).is_asked) break;
  }
  for_each_tiled(team, s.contacts, [&](Index p) {
    for (Index k = 0; k < 3; ++k) s.x.at(k, p) = s.best.at(k, p);
  });
  progress.momentum = SiMomentum<Real>{};
  evaluate_first(team, env, s, params, progress);
}

/// Solves one environment in one sub-step: without waiting as far as that leads, then by colours. At least one chunk of
/// coloured sweeps ends it.
template <DealingTeam TeamT, class Real, Law kLaw>
void solve_asynchronously(TeamT& team, const BodyEnv<Real>& env, const BodySystem<Real, kLaw>& s,
                          const SiParams& params) {
  SiProgress<Real> progress;
  if (!start_bodies(team, env, s, params, progress) || check_bodies(team, env, s, params, progress)) return;
  sweep_ahead(team, env, s, params, progress);
  do {
    advance_bodies(team, env, s, params, progress);
  } while (!check_bodies(team, env, s, params, progress));
}

/// BodySweeps for a team that can deal out: a field of the job decides.
template <Law kLaw, class Precision>
struct DealtSweeps : BodySweeps<kLaw, Precision> {
  using Real = Precision;
  using Base = BodySweeps<kLaw, Real>;

  template <DealingTeam TeamT>
  static void solve(TeamT& team, const BodyJob<Real>& job, const BodyEnv<Real>& env, Real* numbers, double* exact) {
    if constexpr (kLaw == Law::convex) {
      if (job.options.asynchronous) {
        const SiParams params = si_params(job.stepping, job.options);
        const typename Base::System system(env.kept, env.bodies, params, numbers, exact);
        return solve_asynchronously(team, env, system, params);
      }
    }
    Base::solve(team, job, env, numbers, exact);
  }
};

}  // namespace stiction::inline STICTION_ISA
