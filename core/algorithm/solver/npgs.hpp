#pragma once

#include "core/algorithm/solver/pgs.hpp"
#include "core/algorithm/sweep/nesterov.hpp"

namespace stiction::inline STICTION_ISA {

/// Projected Gauss-Seidel with Nesterov's momentum and adaptive restart (docs/math/npgs.md). Between sweeps the
/// iterate is extrapolated along its last change. x and y = (A + R) x + b are affine in each other, so y is
/// extrapolated with the same numbers and no product is needed. When a sweep changes more than the one before,
/// momentum overshoots and starts over. (O'Donoghue and Candes 2015, by the size of the step: a max-norm is exact, so
/// the decision does not depend on an order of summation.)
struct Npgs {
  static constexpr SolverKind kKind = SolverKind::npgs;
  static STICTION_HD constexpr Workspace workspace() { return {.vectors = 2}; }
  static STICTION_HD constexpr bool needs_symmetry(Law) { return false; }
  static constexpr bool kTakesPairs = true;        ///< as Pgs
  static constexpr bool kTakesBoxFriction = true;  ///< as Pgs
  template <class System>
  static constexpr bool kKeepsMotion = System::kMaintainsMotion;

  /// State between sweeps.
  enum State : Index {
    kTheta = kMethodScalars,  ///< Nesterov's theta of the next sweep
    kBeta,                    ///< factor of the extrapolation of the last change
    kProgress,                ///< size of the last change, in units of w
    kStateEnd
  };

  template <Law kLaw, Team TeamT, class System>
  static STICTION_HD void start(TeamT& team, System& s) {
    using Real = typename System::Real;
    const auto x_before = s.vector(0);
    const auto y_before = s.vector(1);
    for_each(team, s.n, [&](Index i) {
      x_before[i] = s.x[i];
      if constexpr (System::kMaintainsMotion) y_before[i] = s.y[i];
    });
    const NesterovStep<Real> fresh = without_momentum<Real>();
    single(team, [&] {
      s.scalar[kTheta] = fresh.next;
      s.scalar[kBeta] = fresh.beta;
      s.scalar[kProgress] = Real(__builtin_huge_valf());
    });
  }

  template <Law kLaw, Team TeamT, class System>
  static STICTION_HD void iterate(TeamT& team, System& s, const MethodParams<Scalar<typename System::Real>>& params) {
    const auto next = extrapolate(team, s);
    const auto progress = sweep_by_law<kLaw>(team, s, typename System::Real(params.omega));
    update_momentum(team, s, next, progress);
  }
  template <Law kLaw, Team TeamT, class System>
  static STICTION_HD void iterate(TeamT& team, SystemPair<System>& s,
                                  const MethodParams<Scalar<typename System::Real>>& params) {
    const auto next_a = extrapolate(team, s.a);
    const auto next_b = extrapolate(team, s.b);
    const auto progress = sweep_by_law<kLaw>(team, s, typename System::Real(params.omega));
    update_momentum(team, s.a, next_a, progress.a);
    update_momentum(team, s.b, next_b, progress.b);
  }

  template <Team TeamT, class System>
  static STICTION_HD void refresh(TeamT& team, System& s, Mask<typename System::Real> due) {
    if constexpr (System::kMaintainsMotion) refresh_motion(team, s, due, s.vector(1));
  }

  /// Momentum starts over where asked: nothing is extrapolated, and no sweep can change more than the one before.
  template <class System, class Real = typename System::Real>
  static STICTION_HD void restart(System& s, Mask<Real> where) {
    const NesterovStep<Real> fresh = without_momentum<Real>();
    s.scalar[kTheta] = select(where, fresh.next, s.scalar[kTheta]);
    s.scalar[kBeta] = select(where, fresh.beta, s.scalar[kBeta]);
    s.scalar[kProgress] = select(where, Real(__builtin_huge_valf()), s.scalar[kProgress]);
  }

 private:
  /// At theta = 1 nothing is extrapolated.
  template <class Real>
  static STICTION_HD NesterovStep<Real> without_momentum() {
    return {Real(nesterov_step(Scalar<Real>(1)).next), Real(0)};
  }

  /// Moves the iterate on along its last change. Returns the step of the next iteration if there is no restart. Its
  /// root and quotient are computed here so that they overlap with the sweep.
  template <Team TeamT, class System, class Real = typename System::Real>
  static STICTION_HD NesterovStep<Real> extrapolate(TeamT& team, System& s) {
    const auto x_before = s.vector(0);
    const auto y_before = s.vector(1);
    const Real beta = s.scalar[kBeta];
    const Real theta = s.scalar[kTheta];
    for_each(team, s.n, [&](Index i) {
      const Real x = s.x[i];
      s.x[i] = fma_(beta, x - x_before[i], x);
      x_before[i] = x;
      if constexpr (System::kMaintainsMotion) {
        const Real y = s.y[i];
        s.y[i] = fma_(beta, y - y_before[i], y);
        y_before[i] = y;
      }
    });
    return nesterov_step(theta);
  }

  /// After a sweep whose largest step was `progress`.
  template <Team TeamT, class System, class Real = typename System::Real>
  static STICTION_HD void update_momentum(TeamT& team, System& s, const NesterovStep<Real>& next, Real progress) {
    const auto restarts = progress > s.scalar[kProgress];
    const NesterovStep<Real> fresh = without_momentum<Real>();
    team.sync();
    single(team, [&] {
      s.scalar[kTheta] = select(restarts, fresh.next, next.next);
      s.scalar[kBeta] = select(restarts, fresh.beta, next.beta);
      s.scalar[kProgress] = progress;
    });
  }
};

}  // namespace stiction::inline STICTION_ISA
