#pragma once

#include "core/body/pgs_body.hpp"

namespace stiction::inline STICTION_ISA {

/// Projected Gauss-Seidel with Nesterov's momentum and adaptive restart (docs/math/npgs.md). Between sweeps the
/// iterate is extrapolated along its last change; x and y = (A + R) x + b are affine in each other, so y is
/// extrapolated with the same numbers and no product is needed. When a sweep changes more than the one before, momentum
/// overshoots and starts over (O'Donoghue and Candes 2015, by the size of the step: a max-norm is exact, so the
/// decision does not depend on an order of summation).
struct Npgs {
  static constexpr SolverKind kKind = SolverKind::npgs;
  static STICTION_HD constexpr MethodRoom room() { return {2}; }
  static STICTION_HD constexpr bool needs_symmetry(Law) { return false; }
  static constexpr bool kTakesPairs = true;  ///< as Pgs
  template <class System>
  static constexpr bool kKeepsMotion = System::kMaintainsMotion;

  template <Law kLaw, Block B, class System>
  static STICTION_HD void start(B& block, System& s) {
    using Real = typename System::Real;
    const auto x_before = s.vector(0);
    const auto y_before = s.vector(1);
    for_each(block, s.n, [&](Index i) {
      x_before[i] = s.x[i];
      if constexpr (System::kMaintainsMotion) y_before[i] = s.y[i];
    });
    const Momentum<Real> fresh = without_momentum<Real>();
    single(block, [&] {
      s.scalar[kTheta] = fresh.theta;
      s.scalar[kBeta] = fresh.beta;
      s.scalar[kProgress] = Real(__builtin_huge_valf());
    });
  }

  template <Law kLaw, Block B, class System>
  static STICTION_HD void iterate(B& block, System& s, const MethodParams<Scalar<typename System::Real>>& params) {
    const auto next = extrapolate(block, s);
    const auto progress = sweep<kLaw>(block, s, typename System::Real(params.omega));
    keep(block, s, next, progress);
  }
  template <Law kLaw, Block B, class System>
  static STICTION_HD void iterate(B& block, SystemPair<System>& s,
                                  const MethodParams<Scalar<typename System::Real>>& params) {
    const auto next_a = extrapolate(block, s.a);
    const auto next_b = extrapolate(block, s.b);
    const auto progress = sweep<kLaw>(block, s, typename System::Real(params.omega));
    keep(block, s.a, next_a, progress.a);
    keep(block, s.b, next_b, progress.b);
  }

  template <Block B, class System>
  static STICTION_HD void refresh(B& block, System& s, Mask<typename System::Real> due) {
    if constexpr (System::kMaintainsMotion) refresh_motion(block, s, due, s.vector(1));
  }

  /// Momentum starts over where asked: nothing is extrapolated, and no sweep can change more than the one before.
  template <class System, class Real = typename System::Real>
  static STICTION_HD void restart(System& s, Mask<Real> where) {
    const Momentum<Real> fresh = without_momentum<Real>();
    s.scalar[kTheta] = select(where, fresh.theta, s.scalar[kTheta]);
    s.scalar[kBeta] = select(where, fresh.beta, s.scalar[kBeta]);
    s.scalar[kProgress] = select(where, Real(__builtin_huge_valf()), s.scalar[kProgress]);
  }

 private:
  /// Of an iteration with Nesterov's theta: what the last change is extrapolated by, and the theta of the next one if
  /// momentum goes on. They are found one iteration ahead, so that a sweep hides their root and quotient.
  template <class Real>
  struct Momentum {
    Real theta;
    Real beta;
  };
  /// theta' solves theta'^2 = (1 - theta') theta^2.
  template <class Real>
  static STICTION_HD Momentum<Real> momentum_at(Real theta) {
    const Real square = theta * theta;
    const Real next = Real(0.5) * (sqrt_(fma_(square, square, Real(4) * square)) - square);
    return {next, div_(theta * (Real(1) - theta), square + next)};
  }
  /// At theta = 1 beta is 0.
  template <class Real>
  static STICTION_HD Momentum<Real> without_momentum() {
    return {Real(momentum_at(Scalar<Real>(1)).theta), Real(0)};
  }

  /// Moves the iterate on along its last change. Returns the momentum of the next iteration if there is no restart.
  template <Block B, class System, class Real = typename System::Real>
  static STICTION_HD Momentum<Real> extrapolate(B& block, System& s) {
    const auto x_before = s.vector(0);
    const auto y_before = s.vector(1);
    const Real beta = s.scalar[kBeta];
    const Real theta = s.scalar[kTheta];
    for_each(block, s.n, [&](Index i) {
      const Real x = s.x[i];
      s.x[i] = fma_(beta, x - x_before[i], x);
      x_before[i] = x;
      if constexpr (System::kMaintainsMotion) {
        const Real y = s.y[i];
        s.y[i] = fma_(beta, y - y_before[i], y);
        y_before[i] = y;
      }
    });
    return momentum_at(theta);
  }

  /// After a sweep whose largest step was `progress`.
  template <Block B, class System, class Real = typename System::Real>
  static STICTION_HD void keep(B& block, System& s, const Momentum<Real>& next, Real progress) {
    const auto restarts = progress > s.scalar[kProgress];
    const Momentum<Real> fresh = without_momentum<Real>();
    block.sync();
    single(block, [&] {
      s.scalar[kTheta] = select(restarts, fresh.theta, next.theta);
      s.scalar[kBeta] = select(restarts, fresh.beta, next.beta);
      s.scalar[kProgress] = progress;
    });
  }
};

}  // namespace stiction::inline STICTION_ISA
