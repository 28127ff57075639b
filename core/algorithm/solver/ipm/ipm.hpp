#pragma once

#include "core/algorithm/solver/ipm/ipm_directions.hpp"
#include "core/algorithm/solver/ipm/ipm_start.hpp"
#include "core/algorithm/solver/method.hpp"
#include "core/algorithm/sweep/sweep.hpp"

namespace stiction::inline STICTION_ISA {

/// Primal-dual interior point with Mehrotra's predictor and corrector and Nesterov-Todd scaling (docs/math/ipm.md).
/// One factorisation an iteration; where there is no room for matrices, conjugate gradients instead. Under the Coulomb
/// law de Saxce's shift is taken from the point before. The barrier may not fall faster than the shift settles.
struct Ipm {
  static constexpr SolverKind kKind = SolverKind::ipm;
  static STICTION_HD constexpr Workspace workspace() {
    return {.f64_vectors = IpmSpace::kVectors,
            .dense_matrices = IpmSpace::kMatrices,
            .matrix_free_vectors = IpmSpace::kMatrixFreeVectors};
  }
  /// Under the Coulomb law there is no function to descend, and nothing is lost by trying on an asymmetric A.
  static STICTION_HD constexpr bool needs_symmetry(Law law) { return law == Law::convex; }
  template <class System>
  static constexpr bool kKeepsMotion = false;

  /// Iterations without a residual smaller by a tenth before the method ends.
  static STICTION_HD constexpr int patience(Law law) { return law == Law::coulomb ? 60 : 10; }
  /// A residual that many times the best is not coming back.
  static constexpr float kLost = 1e12F;
  /// Complementarity kept for every unit of the shift's move.
  static constexpr double kShiftGuard = 0.1;

  /// State between iterations.
  enum State : Index {
    kTerms = kMethodScalars,  ///< terms of the barrier
    kWaited,                  ///< iterations since the residual fell by a tenth; -1: none has been recorded
    kSmallest,                ///< the residual then
  };

  template <Law kLaw, Team TeamT, class System>
  static STICTION_HD_OUTLINE void start(TeamT& team, System& s) {
    using Real = typename System::Real;
    const IpmSpace p(s);
    const double terms = start_interior(team, s, p);
    single(team, [&] {
      s.scalar[kTerms] = static_cast<Real>(terms);
      s.scalar[kWaited] = -1;
      s.scalar[kSmallest] = static_cast<Real>(__builtin_huge_valf());
    });
  }

  template <Law kLaw, Team TeamT, class System>
  static STICTION_HD_OUTLINE void iterate(TeamT& team, System& s, const MethodParams<Scalar<typename System::Real>>&) {
    const IpmSpace p(s);
    const auto terms = static_cast<double>(s.scalar[kTerms]);
    const double drift = refresh_motion_wide<kLaw>(team, s, p);
    scale_cones(team, s, p);
    const double gap = complementarity(team, s, p);
    if (terms > 0.0 && !(gap > 0.0 && finite_(gap))) {
      write_point(team, s, p);
      single(team,
             [&] { s.scalar[kOutcome] = static_cast<typename System::Real>(finite_(gap) ? kFinished : kGaveUp); });
      return;
    }
    factor_step(team, s, p);
    const double centring = predict(team, s, p, gap);
    double target = terms > 0.0 ? div_(gap * centring, terms) : 0.0;
    if (law_of<kLaw>(s) == Law::coulomb && terms > 0.0)
      target = max_(target, div_(min_(kShiftGuard * drift, gap), terms));
    correct(team, s, p, target);
    write_point(team, s, p);
    watch<kLaw>(team, s);
  }

  template <Team TeamT, class System>
  static STICTION_HD void refresh(TeamT&, System&, Mask<typename System::Real>) {}

 private:
  /// motion = A x + b + shift, the shift being norm(y_t) of the same motion. Returns the work of the shift's change.
  template <Law kLaw, Team TeamT, class System>
  static STICTION_HD_OUTLINE double refresh_motion_wide(TeamT& team, const System& s, const IpmSpace& p) {
    multiply_wide(team, s, p, p.x, [&](Index i, double value) { p.motion[i] = value + static_cast<double>(s.b[i]); });
    if (law_of<kLaw>(s) == Law::convex) return 0.0;
    s.for_each_cone(team, [&](auto shape, Index, Index row) {
      using Shape = decltype(shape);
      for (int k = 0; k < Shape::kRows; ++k) p.work[row + k] = 0.0;
      if constexpr (Shape::kKind == ConeKind::friction) {
        double sum = 0.0;
        for (int k = 1; k < Shape::kRows; ++k) sum = fma_(p.motion[row + k], p.motion[row + k], sum);
        const double fresh = sqrt_(sum);
        p.work[row] = abs_(fresh - p.shift[row]) * p.x[row];
        p.shift[row] = fresh;
        p.motion[row] = p.motion[row] + fresh;
      }
    });
    return sum_values(team, p.work, p.n);
  }

  /// The point as the solve's numbers, inside the cones to the last bit.
  template <Team TeamT, class System>
  static STICTION_HD_OUTLINE void write_point(TeamT& team, System& s, const IpmSpace& p) {
    using Real = typename System::Real;
    s.for_each_cone(team, [&](auto shape, Index cone, Index row) {
      using Shape = decltype(shape);
      Real z[Shape::kRows];
      Real still[Shape::kRows];
      for (int k = 0; k < Shape::kRows; ++k) {
        z[k] = static_cast<Real>(p.x[row + k]);
        still[k] = 0;
      }
      proximal_point(shape, z, still, Real(0), s.lo[cone], s.hi[cone], Law::convex);
      for (int k = 0; k < Shape::kRows; ++k) s.x[row + k] = z[k];
    });
  }

  /// Ends a run whose residual no longer falls. Reads the record of the iteration before; the first iteration's was
  /// not an interior point.
  template <Law kLaw, Team TeamT, class System>
  static STICTION_HD_OUTLINE void watch(TeamT& team, System& s) {
    using Real = typename System::Real;
    single(team, [&] {
      Real& smallest = s.scalar[kSmallest];
      Real& waited = s.scalar[kWaited];
      const Real last = s.scalar[kLastResidual];
      const bool is_first = waited < Real(0);
      const bool improved = !is_first && last < Real(0.9F) * smallest;
      if (improved) smallest = last;
      waited = is_first || improved ? Real(0) : waited + Real(1);
      if (waited >= Real(patience(law_of<kLaw>(s)))) s.scalar[kOutcome] = Real(kFinished);
      if (!is_first && last > Real(kLost) * smallest) s.scalar[kOutcome] = Real(kGaveUp);
    });
  }
};

}  // namespace stiction::inline STICTION_ISA
