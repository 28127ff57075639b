#pragma once

#include "core/algorithm/load/islands.hpp"
#include "core/algorithm/load/load_system.hpp"
#include "core/algorithm/problem/stop_rule.hpp"
#include "core/algorithm/residual/final_residual.hpp"

namespace stiction::inline STICTION_ISA {

/// State that one check of convergence leaves to the next: of one environment, or in every lane.
template <class Real>
struct Search {
  Counts<Real> iterations = Counts<Real>(0);  ///< done so far
  Counts<Real> best_at = Counts<Real>(0);     ///< iteration at which the best residual was recorded
  Real best = Real(0);                        ///< that residual, once iterations or best_at moved
  Real verified = Real(-1);  ///< estimate whose iterate failed the final residual; not evaluated a second time
};
/// Progress of one environment. Lanes of a team hold equal copies.
template <class Real>
struct EnvProgress : Search<Real> {
  std::uint32_t flags = 0;  ///< EnvFlag bits from preparing
};

/// If all contacts obey their law, those that cannot move need not: others have stilled what they would have
/// followed.
template <Team TeamT, class Real>
STICTION_HD void write_status(TeamT& team, const EnvView<Real>& env, EnvCode code, SolverKind solver,
                              std::uint32_t flags, Index iterations, double relative, double absolute) {
  if (code == EnvCode::solved) flags &= ~static_cast<std::uint32_t>(kFlagImmovable);
  single(team, [&] { *env.status = EnvStatus{relative, absolute, flags, iterations, code, solver, {0, 0}, 0}; });
}

/// Writes the safe answer for an environment that cannot be solved: lambda = 0. With invalid input w = 0 as well, since
/// w = b could carry the NaN; for an unsupported system w = b.
template <Team TeamT, class Real>
STICTION_HD_OUTLINE void reject(TeamT& team, const EnvView<Real>& env, SolverKind solver, std::uint32_t flags) {
  const bool unsupported =
      (flags & ~(kHarmlessFlags | kFlagAsymmetric | kFlagOverCapacity | kFlagUnsupportedCone)) == 0;
  for_each(team, env.n, [&](Index i) {
    env.lambda[i] = 0;
    if (env.w != nullptr) env.w[i] = unsupported ? canonical_zero(env.b[i]) : Real(0);
  });
  const double infinite = __builtin_huge_val();
  write_status(team, env, unsupported ? EnvCode::unsupported : EnvCode::invalid_input, solver, flags, 0, infinite,
               infinite);
}

/// Writes the status of an environment without rows, which is solved.
template <Team TeamT, class Real>
STICTION_HD void write_empty(TeamT& team, const EnvView<Real>& env, SolverKind solver) {
  write_status(team, env, EnvCode::solved, solver, env.flags, 0, 0.0, 0.0);
}

/// Writes the best iterate in the batch's units and order.
template <Team TeamT, class Real, class System>
STICTION_HD_SHARED void write_solution(TeamT& team, const EnvView<Real>& env, const System& s) {
  const Real unscale = div_(s.scalar[kScaleA], s.scalar[kScaleB]);
  for_each_slot(team, env, s, [&](Index cone, ConeSlot slot) {
    const Index first = env.cone_row(cone);
    const bool needs_nothing = s.island[slot.cone] == Real(static_cast<Scalar<Real>>(kIdleIsland<Real>));
    for (Index k = 0; k < env.cone_size(cone); ++k) {
      const Index i = env.row_of(first, env.cone_size(cone), k);
      const Real scale = row_scale(env, env.kind[cone], k, i);
      env.lambda[i] = canonical_zero((s.best[slot.row + k] * scale) * unscale);
      if (needs_nothing) env.lambda[i] = Real(0);
    }
  });
}

/// Relative residual beyond which no reaction at all is tried as an answer: a method that collapsed, not one that
/// was short of iterations.
inline constexpr double kWorseThanNothing = 1e3;

/// Result of polling between chunks: of one environment, or in every lane.
template <class Condition>
struct Poll {
  Condition broken;         ///< the latest iterate is not of numbers
  Condition stalled;        ///< no better one was found for as long as was allowed
  Condition stopped;        ///< the method has ended
  Condition ended;          ///< one of these, or no iterations are left
  Condition has_candidate;  ///< the best iterate may be an answer
};
using EnvPoll = Poll<bool>;

template <class Real>
STICTION_HD bool is_within(Real residual, double tolerance) {
  return static_cast<double>(residual) <= tolerance;
}
template <class Real>
STICTION_HD bool exceeds(Real a, double b) {
  return static_cast<double>(a) > b;
}
template <class Real>
STICTION_HD bool exceeds(double a, Real b) {
  return a > static_cast<double>(b);
}
STICTION_HD bool exceeds(double a, double b) {
  return a > b;
}

/// Returns true if the best iterate may be an answer. Its estimate is within the tolerance, or roundings of its
/// reactions are more than that and all that is left.
template <class Real, class System, class Tolerance>
STICTION_HD Mask<Real> is_proposed(const System& s, const Limits<Tolerance, Counts<Real>>& rule, Real best) {
  const Real rounding = Real(static_cast<Scalar<Real>>(kUnitRoundoff<Real>)) * s.scalar[kBestReaction];
  const auto is_rounded = and_(best <= Real(static_cast<Scalar<Real>>(kRoundingReach)) * rounding,
                               and_(exceeds(rounding, rule.tolerance), exceeds(rule.tolerance, Real(0))));
  const Real absolute = best * div_(s.scalar[kErrorScale], s.scalar[kScaleB]);
  return or_(or_(is_within(best, rule.tolerance), is_rounded),
             and_(is_within(absolute, rule.absolute), exceeds(rule.absolute, Real(0))));
}

/// Updates the best iterate so far and returns true if anything is to be done.
template <class Real, class System, class Tolerance>
STICTION_HD Poll<Mask<Real>> poll_progress(const System& s, const Limits<Tolerance, Counts<Real>>& rule,
                                           Search<Real>& search) {
  const Real best = s.scalar[kBestResidual];
  const auto is_better = or_(of_reals<Real>(search.iterations == Counts<Real>(0)), best < search.best);
  search.best = select(is_better, best, search.best);
  search.best_at = select(of_counts<Real>(is_better), search.iterations, search.best_at);
  const Counts<Real> waited = search.iterations - search.best_at;
  Poll<Mask<Real>> poll;
  poll.broken = not_(finite_(s.scalar[kLastResidual]));
  poll.stalled = of_reals<Real>(and_(rule.stall_window > Counts<Real>(0), waited >= rule.stall_window));
  poll.stopped = s.scalar[kOutcome] != Real(kRunning);
  poll.ended =
      or_(or_(poll.broken, poll.stalled), or_(poll.stopped, of_reals<Real>(search.iterations >= rule.max_iterations)));
  poll.has_candidate = and_(is_proposed<Real>(s, rule, best), best != search.verified);
  return poll;
}

/// Returns true if an answer with that relative residual is to be compared with zero, should it be the last.
STICTION_HD bool is_collapsed(double relative) {
  return !(relative <= kWorseThanNothing);
}

/// True when the environment is finished with an answer of that verdict, and then its status is written. `best`: the
/// estimate of the candidate.
template <class Method, Team TeamT, class Real>
STICTION_HD bool finalize(TeamT& team, const EnvView<Real>& env, const EnvPoll& poll, Real best, const Verdict& verdict,
                          EnvProgress<Real>& progress) {
  progress.verified = best;
  if (!verdict.is_final() && !poll.ended) return false;
  const EnvCode code = verdict.code(poll.broken                    ? EnvCode::numerical
                                    : poll.stalled || poll.stopped ? EnvCode::stalled
                                                                   : EnvCode::max_iterations);
  write_status(team, env, code, Method::kKind, progress.flags, progress.iterations, verdict.relative, verdict.absolute);
  return true;
}

/// Returns the allowance that an environment's answer is compared with.
STICTION_HD Allowance allowance(const StopRule& rule) {
  return {rule.tolerance, rule.absolute};
}

/// True when the environment is finished, and then its answer and status are written. The estimate the iteration works
/// with only proposes a candidate. The residual that decides, and is reported, is computed in double from the batch's
/// own numbers and the returned bits of lambda.
template <class Method, Team TeamT, class Real, class System>
STICTION_HD_OUTLINE bool evaluate_candidate(TeamT& team, const EnvView<Real>& env, const System& s,
                                            const StopRule& rule, const EnvPoll& poll, EnvProgress<Real>& progress) {
  const Real best = s.scalar[kBestResidual];
  write_solution(team, env, s);
  const ErrorScale scale = error_scale_of(s);
  constexpr bool kMatrices = kTakesSemidefinite<Method> && kMayHaveSemidefinite<System>;
  const auto evaluate = [&] {
    return judge<Real>(final_residual<kMatrices>(team, env, residual_rows(team, env, s), island_shares(s), scale),
                       scale.largest, allowance(rule));
  };
  Verdict verdict = evaluate();
  if (poll.ended && is_collapsed(verdict.relative)) {
    // No iterate had an answer that is of use in the batch's units; zero is always an answer there.
    for_each(team, env.n, [&](Index i) { env.lambda[i] = 0; });
    const Verdict of_nothing = evaluate();
    if (finite_(verdict.relative) && !(of_nothing.relative < verdict.relative)) {
      write_solution(team, env, s);
      verdict = evaluate();
    } else {
      verdict = of_nothing;
    }
  }
  return finalize<Method>(team, env, poll, best, verdict, progress);
}

/// Checks an environment between chunks: true when it is finished.
template <class Method, Team TeamT, class Real, class System>
STICTION_HD bool check_convergence(TeamT& team, const EnvView<Real>& env, const System& s, const StopRule& rule,
                                   EnvProgress<Real>& progress) {
  const EnvPoll poll = poll_progress<Real>(s, rule, progress);
  if (s.scalar[kOutcome] == Real(kRayDetected)) progress.flags |= kFlagRay;
  // Every lane has read the scalars before one of them goes on to the next chunk and writes them.
  team.sync();
  return (poll.has_candidate || poll.ended) && evaluate_candidate<Method>(team, env, s, rule, poll, progress);
}

}  // namespace stiction::inline STICTION_ISA
