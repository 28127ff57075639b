#pragma once

#include "core/algorithm/solver/admm/anderson.hpp"
#include "core/algorithm/solver/admm/penalized_system.hpp"
#include "core/algorithm/solver/method.hpp"
#include "core/algorithm/sweep/sweep.hpp"

namespace stiction::inline STICTION_ISA {

/// Alternating directions (docs/math/admm.md): a solve with K + rho, a projection, a dual update, over-relaxed; de
/// Saxce's shift is taken from the dual. Anderson's acceleration on the whole iteration, and levels of rho.
struct Admm {
  static constexpr SolverKind kKind = SolverKind::admm;
  static STICTION_HD constexpr Workspace workspace() {
    return {
        .f64_vectors = AdmmState::kVectors, .dense_matrices = 1, .matrix_free_vectors = AdmmState::kMatrixFreeVectors};
  }
  static constexpr Index kChunk = stiction::kChunk;
  static STICTION_HD constexpr bool needs_symmetry(Law law) { return law == Law::convex; }
  template <class System>
  static constexpr bool kKeepsMotion = false;
  static constexpr bool kProjectsMatrices = true;

  static constexpr double kRelaxation = 1.6;
  static constexpr double kGrowth = 2.0;      ///< of the plain step's length beyond which a guess is taken back
  static constexpr double kImbalance = 10.0;  ///< of primal and dual residual beyond which rho changes
  static constexpr Index kCheckInterval = 12;
  static_assert(kCheckInterval % kChunk == 0);
  static constexpr Index kMostSwitches = 4;
  static constexpr Index kPenaltyLevels = 6;

  /// State between iterations.
  enum State : Index {
    kLargestEigenvalue = kMethodScalars,  ///< of the scaled A + R
    kSkewness,                            ///< largest difference between an entry of A and its mirror image, scaled
    kPenaltyLevel,                        ///< level of the penalty
    kSwitches,                            ///< how often it has changed
    kAge,                                 ///< iterations since it was last looked at
    kHistory,                             ///< steps that the acceleration remembers; -1: not even where it began
    kLength,                              ///< of the last plain step
    kStateEnd
  };
  static_assert(kStateEnd <= static_cast<Index>(kStateScalars));
  static constexpr Index kFirstPenaltyLevel = 2;
  static STICTION_HD double penalty_share(Index k) {
    constexpr double kShare[kPenaltyLevels] = {1.0, 0.3, 0.1, 0.03, 0.01, 0.003};
    return kShare[k];
  }

  template <Law kLaw, Team TeamT, class System>
  static STICTION_HD_OUTLINE void start(TeamT& team, System& s) {
    using Real = typename System::Real;
    const AdmmState a = AdmmState::of(s);
    s.for_each_cone(team, [&](auto shape, Index, Index row) {
      constexpr int kRows = decltype(shape)::kRows;
      double diagonal_sum = 0.0;
      for (int k = 0; k < kRows; ++k) diagonal_sum = diagonal_sum + static_cast<double>(s.block_entry(row, k, k));
      const double mean = div_(diagonal_sum, static_cast<double>(kRows));
      for (int k = 0; k < kRows; ++k) a.scale[row + k] = mean > 0.0 ? div_(1.0, sqrt_(mean)) : 1.0;
    });
    const double skewness = fill_scaled(team, s, a);
    const double largest = largest_eigenvalue(team, s, a);
    single(team, [&] {
      s.scalar[kLargestEigenvalue] = static_cast<Real>(largest);
      s.scalar[kSkewness] = static_cast<Real>(skewness);
      s.scalar[kPenaltyLevel] = Real(kFirstPenaltyLevel);
      s.scalar[kSwitches] = s.scalar[kAge] = Real(0);
    });
    const double rho = penalty(s);
    factor_penalized(team, s, a, rho);
    if (a.form == AdmmForm::gradients) for_each(team, a.n, [&](Index i) { a.answer[i] = 0.0; });
    // The dual of the start's own motion.
    s.for_each_cone(team, [&](auto shape, Index cone, Index row) {
      constexpr int kRows = decltype(shape)::kRows;
      double y[kRows];
      for (int k = 0; k < kRows; ++k) y[k] = static_cast<double>(s.y[row + k]) * a.scale[row + k];
      if constexpr (decltype(shape)::kKind == ConeKind::friction)
        if (law_of<kLaw>(s) == Law::coulomb && !is_semidefinite(shape, s, cone))
          y[0] = y[0] + tangential_norm<kRows>(y);
      for (int k = 0; k < kRows; ++k) {
        a.g[row + k] = div_(static_cast<double>(s.x[row + k]), a.scale[row + k]);
        if constexpr (decltype(shape)::kKind != ConeKind::free) a.g[row + k] = a.g[row + k] - div_(y[k], rho);
        // The point to which a first step is taken back if it is not a number.
        a.image_before[row + k] = a.g[row + k];
      }
      project(s, a, shape, cone, row);
    });
    if (skewness > 0.0) refresh_motion(team, s);
    forget(team, s);
  }

  template <Law kLaw, Team TeamT, class System>
  static STICTION_HD_OUTLINE void iterate(TeamT& team, System& s, const MethodParams<Scalar<typename System::Real>>&) {
    using Real = typename System::Real;
    const AdmmState a = AdmmState::of(s);
    const double rho = penalty(s);
    const Index age = static_cast<Index>(s.scalar[kAge]);
    const bool is_skew = s.scalar[kSkewness] > Real(0);
    if (is_skew && age % kChunk == 0) find_skew(team, s, a, rho);
    s.for_each_cone(team, [&](auto shape, Index cone, Index row) {
      constexpr int kRows = decltype(shape)::kRows;
      double u[kRows];
      for (int k = 0; k < kRows; ++k) {
        u[k] = a.g[row + k] - a.z[row + k];
        const double own = own_penalty(shape, rho);
        double load = static_cast<double>(s.b[row + k]) * a.scale[row + k];
        if (is_skew) load = load + a.skew[row + k];
        a.v[row + k] = fma_(own, a.z[row + k] - u[k], 0.0 - load);
      }
      if constexpr (decltype(shape)::kKind == ConeKind::friction)
        if (law_of<kLaw>(s) == Law::coulomb && !is_semidefinite(shape, s, cone))
          a.v[row] = fma_(0.0 - rho, tangential_norm<kRows>(u), a.v[row]);
    });
    solve_penalized(team, s, a, rho);
    double apart = 0.0;
    s.for_each_cone(team, [&](auto shape, Index, Index row) {
      for (int k = 0; k < decltype(shape)::kRows; ++k) {
        const double gap = a.v[row + k] - a.z[row + k];
        a.f[row + k] = decltype(shape)::kKind == ConeKind::free ? gap : kRelaxation * gap;
        if constexpr (decltype(shape)::kKind != ConeKind::free) apart = max_(abs_(gap), apart);
      }
    });
    move(team, s, a);
    double moved = 0.0;
    double largest_z = 0.0;
    double largest_u = 0.0;
    s.for_each_cone(team, [&](auto shape, Index cone, Index row) {
      constexpr int kRows = decltype(shape)::kRows;
      double before[kRows];
      for (int k = 0; k < kRows; ++k) before[k] = a.z[row + k];
      project(s, a, shape, cone, row);
      if constexpr (decltype(shape)::kKind != ConeKind::free) {
        for (int k = 0; k < kRows; ++k) {
          moved = max_(abs_(a.z[row + k] - before[k]), moved);
          largest_z = max_(abs_(a.z[row + k]), largest_z);
          largest_u = max_(abs_(a.g[row + k] - a.z[row + k]), largest_u);
        }
      }
    });
    team.sync();
    single(team, [&] { s.scalar[kAge] = static_cast<Real>((age + 1) % kCheckInterval); });
    if (age + 1 == kCheckInterval)
      balance(team, s, a, team.max(apart) * team.max(largest_u), team.max(moved) * team.max(largest_z));
  }

  template <Team TeamT, class System>
  static STICTION_HD void refresh(TeamT&, System&, Mask<typename System::Real>) {}

 private:
  template <class System>
  static STICTION_HD double penalty(const System& s) {
    return penalty_share(static_cast<Index>(s.scalar[kPenaltyLevel])) *
           static_cast<double>(s.scalar[kLargestEigenvalue]);
  }
  /// z of one cone from its g, and x.
  template <class System, class Shape>
  static STICTION_HD void project(System& s, const AdmmState& a, Shape shape, Index cone, Index row) {
    using Real = typename System::Real;
    constexpr int kRows = Shape::kRows;
    double z[kRows];
    double still[kRows];
    for (int k = 0; k < kRows; ++k) {
      z[k] = a.g[row + k];
      still[k] = 0.0;
    }
    double lo = 0.0;
    double hi = 0.0;
    if constexpr (Shape::kKind == ConeKind::box) {
      lo = div_(static_cast<double>(s.lo[cone]), a.scale[row]);
      hi = div_(static_cast<double>(s.hi[cone]), a.scale[row]);
    }
    cone_proximal_point<Law::convex>(shape, s, cone, z, still, 0.0, lo, hi);
    for (int k = 0; k < kRows; ++k) {
      a.z[row + k] = z[k];
      Real x = static_cast<Real>(z[k] * a.scale[row + k]);
      if constexpr (Shape::kKind == ConeKind::box) x = clamp_(x, s.lo[cone], s.hi[cone]);
      s.x[row + k] = x;
    }
  }

  template <Team TeamT, class System>
  static STICTION_HD_OUTLINE void forget(TeamT& team, System& s) {
    using Real = typename System::Real;
    single(team, [&] {
      s.scalar[kHistory] = Real(-1);
      s.scalar[kLength] = static_cast<Real>(__builtin_huge_valf());
    });
  }

  /// Moves g to the next iterate, which is accelerated unless the last guess made the plain step longer. Then it is
  /// where a plain step from the iterate before would have led.
  template <Team TeamT, class System>
  static STICTION_HD_OUTLINE void move(TeamT& team, System& s, const AdmmState& a) {
    using Real = typename System::Real;
    const double square = sum_leaves<double>(team, [&](Index leaf) {
      double sum = 0.0;
      for (Index i = leaf; i < a.n; i += kReduceLeaves) sum = fma_(a.f[i], a.f[i], sum);
      return sum;
    });
    const double length = sqrt_(square);
    const Index known = static_cast<Index>(s.scalar[kHistory]);
    // Not "longer than": a guess that led to NaN is taken back as well.
    const bool is_accepted = length <= kGrowth * static_cast<double>(s.scalar[kLength]);
    team.sync();
    if (!is_accepted) {
      for_each(team, a.n, [&](Index i) { a.g[i] = a.image_before[i]; });
      forget(team, s);
      return;
    }
    if (known >= 0) {
      const Index slot = known % kAndersonMemory;
      for_each(team, a.n, [&](Index i) {
        a.change_of_f(slot)[i] = a.f[i] - a.f_before[i];
        a.change_of_image(slot)[i] = (a.g[i] + a.f[i]) - a.image_before[i];
      });
    }
    const Index count = known + 1 < kAndersonMemory ? known + 1 : kAndersonMemory;
    const AndersonWeights weights = anderson(team, a.n, a.f, count, [&](Index j) { return a.change_of_f(j); });
    for_each(team, a.n, [&](Index i) {
      const double image = a.g[i] + a.f[i];
      double next = image;
      for (Index j = 0; j < count; ++j) next = fma_(0.0 - weights.gamma[j], a.change_of_image(j)[i], next);
      a.f_before[i] = a.f[i];
      a.image_before[i] = image;
      a.g[i] = next;
    });
    single(team, [&] {
      s.scalar[kHistory] = static_cast<Real>(known + 1 < 2 * kAndersonMemory ? known + 1 : known + 1 - kAndersonMemory);
      s.scalar[kLength] = static_cast<Real>(length);
      if (length == 0.0) s.scalar[kOutcome] = Real(kFinished);
    });
  }

  /// One penalty level up or down where one residual outweighs the other, and a new factor.
  template <Team TeamT, class System>
  static STICTION_HD_OUTLINE void balance(TeamT& team, System& s, const AdmmState& a, double primal, double dual) {
    using Real = typename System::Real;
    const Index at = static_cast<Index>(s.scalar[kPenaltyLevel]);
    const Index switches = static_cast<Index>(s.scalar[kSwitches]);
    const double before = penalty(s);
    Index next = at;
    if (primal > kImbalance * dual && at > 0) next = at - 1;
    if (dual > kImbalance * primal && at + 1 < kPenaltyLevels) next = at + 1;
    if (next == at || switches >= kMostSwitches) return;
    team.sync();
    single(team, [&] {
      s.scalar[kPenaltyLevel] = static_cast<Real>(next);
      s.scalar[kSwitches] = static_cast<Real>(switches + 1);
    });
    const double ratio = div_(before, penalty(s));
    for_each(team, a.n, [&](Index i) { a.g[i] = fma_(a.g[i] - a.z[i], ratio, a.z[i]); });
    fill_scaled(team, s, a);
    factor_penalized(team, s, a, penalty(s));
    forget(team, s);
  }
};

}  // namespace stiction::inline STICTION_ISA
