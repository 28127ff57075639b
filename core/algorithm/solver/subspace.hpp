#pragma once

#include "core/algorithm/linear/dense/square_factor.hpp"
#include "core/algorithm/residual/final_residual.hpp"
#include "core/algorithm/solver/npgs.hpp"

namespace stiction::inline STICTION_ISA {

/// Sweeps with momentum and, between them, a step to where the problem would be solved if every cone kept its contact
/// state. Held contacts hold, sliding ones slide, open ones stay open. (docs/math/subspace.md; Silcowitz, Niebe,
/// Erleben 2010.) The step is a linear system, and one factorisation. Sweeps find the states, the step does away with
/// the slow part of their convergence. It is taken only where the residual falls.
struct Subspace {
  static constexpr SolverKind kKind = SolverKind::subspace;
  static STICTION_HD constexpr Workspace workspace() { return {.vectors = kVectors, .real_matrices = 1}; }
  static STICTION_HD constexpr bool needs_symmetry(Law) { return false; }
  static constexpr bool kTakesPairs = Npgs::kTakesPairs;
  /// It sweeps, without steps: contact states of boxed friction are not looked for.
  static constexpr bool kTakesBoxFriction = true;
  template <class System>
  static constexpr bool kKeepsMotion = Npgs::kKeepsMotion<System>;

  /// The environment's own rows, which a pack's slots are not.
  template <Team TeamT, class Real, class System>
  static STICTION_HD void load(TeamT& team, const EnvView<Real>& env, System& s) {
    const bool sweeps_only = env.counts.box_friction > 0 && env.n <= kMostRows;
    single(team, [&] { s.scalar[kOwnRows] = static_cast<Real>(sweeps_only ? kMostRows + 1 : env.n); });
  }

  template <Law kLaw, Team TeamT, class System>
  static STICTION_HD void start(TeamT& team, System& s) {
    Npgs::start<kLaw>(team, s);
    single(team, [&] {
      s.scalar[kAge] = 0;
      s.scalar[kWait] = 1;
    });
  }

  template <Law kLaw, Team TeamT, class System>
  static STICTION_HD void iterate(TeamT& team, System& s, const MethodParams<Scalar<typename System::Real>>& params) {
    Npgs::iterate<kLaw>(team, s, params);
  }

  template <Team TeamT, class System>
  static STICTION_HD void refresh(TeamT& team, System& s, Mask<typename System::Real> due) {
    Npgs::refresh(team, s, due);
  }

  /// After a chunk whose last iterate has been recorded in the lanes of `due`. A good enough result makes no
  /// difference: the outcome of k iterations must not depend on the limit of iterations.
  template <Law kLaw, Team TeamT, class Real, int kStride>
  static STICTION_HD_OUTLINE void subspace_step(TeamT& team, DenseSystem<Real, kStride>& s, Mask<Real> due) {
    const Real last = s.scalar[kLastResidual];
    const Real age = s.scalar[kAge] + Real(1);
    const Real wait = s.scalar[kWait];
    const auto is_small = s.scalar[kOwnRows] <= Real(kMostRows);
    auto steps = and_(and_(due, age >= wait), and_(is_small, finite_(last)));
    team.sync();
    Real taken(0);
    if (any(steps)) {
      const auto kept_x = s.vector(kKeptX);
      const auto kept_y = s.vector(kKeptY);
      for_each(team, s.n, [&](Index i) {
        kept_x[i] = s.x[i];
        kept_y[i] = s.y[i];
      });
      // Cones that slide by Coulomb's law have an asymmetric matrix.
      const Real sliding = find_zones(team, s);
      if (law_of<kLaw>(s) == Law::coulomb) steps = and_(steps, sliding == Real(0));
      taken = any(steps) ? take_subspace_step<kLaw>(team, s, steps, last) : Real(0);
      const auto gains = taken > Real(0);
      // npgs starts anew from there.
      const auto x_before = s.vector(0);
      const auto y_before = s.vector(1);
      for_each(team, s.n, [&](Index i) {
        s.x[i] = select(gains, s.x[i], kept_x[i]);
        s.y[i] = select(gains, s.y[i], kept_y[i]);
        x_before[i] = select(gains, s.x[i], x_before[i]);
        y_before[i] = select(gains, s.y[i], y_before[i]);
      });
    }
    const auto gains = taken > Real(0);
    single(team, [&] {
      Npgs::restart(s, gains);
      s.scalar[kWait] = select(steps, select(gains, Real(1), Real(2) * wait), wait);
      s.scalar[kAge] = select(steps, Real(0), age);
    });
  }
  /// Other forms of systems are swept alone.
  template <Law kLaw, Team TeamT, class System>
  static STICTION_HD void subspace_step(TeamT&, System&, Mask<typename System::Real>) {}

 private:
  /// Largest environment that takes such steps. A factorisation costs as much as rows / 6 sweeps, if not more
  /// (docs/math/subspace.md).
  static constexpr Index kMostRows = 40;
  /// State besides that of npgs.
  enum State : Index {
    kOwnRows = static_cast<Index>(Npgs::kStateEnd),  ///< rows of the environment, without a pack's padding
    kWait,                                           ///< chunks from step to step: doubled by each that was not taken
    kAge,                                            ///< chunks since the last step
    kStateEnd
  };
  static_assert(kStateEnd <= static_cast<Index>(kStateScalars));
  /// Least pivot, relative to the matrix's own diagonal.
  static constexpr float kLeastPivot = 0x1p-20F;

  enum Vector : Index {
    kKeptX = 2,  ///< the iterate before the step
    kKeptY,      ///< its motion
    kFree,       ///< 1 on the rows of cones that hold or slide, 0 elsewhere
    kNormal,     ///< of a cone that slides: unit normal of its boundary; 0 elsewhere
    kCurvature,  ///< of a cone that slides: its boundary's curvature times its multiplier, on its first row
    kStep,       ///< right side, then the step
    kInverse,    ///< reciprocals of pivots
    kVectors
  };

  /// Moves x and y, in the lanes of `steps`, to the solution of the linear problem. Returns 1 in those whose residual
  /// is below `last` there, and elsewhere 0; these keep `last`.
  template <Law kLaw, Team TeamT, class Real, int kStride>
  static STICTION_HD Real take_subspace_step(TeamT& team, DenseSystem<Real, kStride>& s, Mask<Real> steps, Real last) {
    refresh_motion(team, s);
    const SquareMatrix<Real, kStride> K{s.K, s.n};
    fill(team, s, K);
    right_side(team, s);
    const auto inverse = s.vector(kInverse);
    factor_square(team, K, inverse, [&](Index i) { return Real(kLeastPivot) * s.A[i + s.n * i]; });
    solve_square(team, K, inverse, s.vector(kStep));
    project_step(team, s, steps);
    refresh_motion(team, s);
    update_best<Subspace, kLaw>(team, s, steps);
    const auto gains = and_(steps, s.scalar[kLastResidual] < last);
    team.sync();
    single(team, [&] { s.scalar[kLastResidual] = select(gains, s.scalar[kLastResidual], last); });
    return select(gains, Real(1), Real(0));
  }

  /// The contact state of every cone, and x moved to the point of it that is nearest to where the cone's own step
  /// leads. Returns 1 where some cone slides, else 0.
  template <Team TeamT, class Real, int kStride>
  static STICTION_HD Real find_zones(TeamT& team, DenseSystem<Real, kStride>& s) {
    const auto loose = s.vector(kFree);
    const auto normal = s.vector(kNormal);
    const auto curvature = s.vector(kCurvature);
    Real sliding(0);
    s.for_each_cone(team, [&](auto shape, Index cone, Index row) {
      constexpr int kRows = decltype(shape)::kRows;
      Real z[kRows];
      for (int k = 0; k < kRows; ++k) z[k] = fma_(Real(0) - s.inv_cone[cone], s.y[row + k], s.x[row + k]);
      if constexpr (kRows == 1) {
        const Real seen = z[0];
        Real still[1] = {Real(0)};
        proximal_point(shape, z, still, Real(0), s.lo[cone], s.hi[cone], Law::convex);
        const auto moves = and_(seen == z[0], s.inv_cone[cone] > Real(0));
        if constexpr (decltype(shape)::kKind == ConeKind::unilateral) {
          loose[row] = select(and_(moves, z[0] > Real(0)), Real(1), Real(0));
        } else {
          loose[row] = select(moves, Real(1), Real(0));
        }
        normal[row] = Real(0);
        s.x[row] = z[0];
      } else {
        const Real length = tangential_norm<kRows>(z);
        const auto sticks = length <= z[0];
        const auto separates = length <= Real(0) - z[0];
        const auto slides = not_(or_(sticks, separates));
        const Real inverse = div_(Real(1), select(slides, length, Real(1)));
        const Real root = Real(0.70710678118654752440);
        Real along(0);
        for (int k = 1; k < kRows; ++k) {
          const Real direction = z[k] * inverse;
          along = fma_(direction, s.y[row + k], along);
          normal[row + k] = select(slides, root * direction, Real(0));
          loose[row + k] = select(separates, Real(0), Real(1));
        }
        normal[row] = select(slides, Real(0) - root, Real(0));
        loose[row] = loose[row + 1];
        const Real middle = Real(0.5) * (z[0] + length);
        const Real multiplier = max_(Real(0.5) * (s.y[row] - along), Real(0));
        curvature[row] = select(slides, div_(multiplier, max_(middle, Real(0x1p-20F) * length)), Real(0));
        project_second_order_cone<kRows>(z);
        for (int k = 0; k < kRows; ++k) s.x[row + k] = z[k];
        sliding = select(slides, Real(1), sliding);
      }
    });
    return team.max(sliding);
  }

  /// The matrix of the linear problem: Pi (A + R) Pi + bend (Pi - t t') + (I - Pi). Pi is the projection onto the
  /// directions in which the cones can move, t is along the edge of a sliding one.
  template <Team TeamT, class Real, int kStride>
  static STICTION_HD void fill(TeamT& team, DenseSystem<Real, kStride>& s, const SquareMatrix<Real, kStride>& K) {
    const auto loose = s.vector(kFree);
    const auto normal = s.vector(kNormal);
    const auto curvature = s.vector(kCurvature);
    const Index n = s.n;
    // Column by column, as the matrix lies.
    for_each(team, n, [&](Index j) {
      s.for_each_in_order([&](auto shape, Index, Index row) {
        constexpr int kRows = decltype(shape)::kRows;
        if (row + kRows <= j) return;
        Real part(0);
        if constexpr (kRows > 1)
          for (int k = 0; k < kRows; ++k) part = fma_(normal[row + k], s.A[row + k + n * j], part);
        for (int k = 0; k < kRows; ++k) {
          const Real own = loose[row + k] * s.A[row + k + n * j];
          K(row + k, j) = kRows > 1 ? fma_(Real(0) - normal[row + k], part, own) : own;
        }
      });
    });
    s.for_each_cone(team, [&](auto shape, Index, Index row) {
      constexpr int kRows = decltype(shape)::kRows;
      Real u[kRows];
      Real v[kRows];
      for (int k = 0; k < kRows; ++k) {
        u[k] = loose[row + k];
        v[k] = normal[row + k];
      }
      for (Index i = row; i < n; ++i) {
        Real a[kRows];
        for (int k = 0; k < kRows; ++k) a[k] = K(i, row + k);
        Real part(0);
        if constexpr (kRows > 1)
          for (int k = 0; k < kRows; ++k) part = fma_(v[k], a[k], part);
        for (int k = 0; k < kRows; ++k) {
          a[k] = u[k] * a[k];
          if constexpr (kRows > 1) a[k] = fma_(Real(0) - v[k], part, a[k]);
          K(i, row + k) = a[k];
        }
      }
      // Pi - t t' is I - 2 q q' on the tangential rows. There q = v, when v has the length 1 and t is its mirror
      // image.
      for (int i = 0; i < kRows; ++i)
        for (int j = 0; j <= i; ++j) {
          Real extra = i == j ? Real(1) - u[i] : Real(0);
          if constexpr (kRows > 1) {
            extra = fma_(v[i], v[j], extra);
            if (j > 0) extra = fma_(curvature[row], (i == j ? Real(1) : Real(0)) - Real(2) * (v[i] * v[j]), extra);
          }
          K(row + i, row + j) = K(row + i, row + j) + extra;
        }
    });
  }

  /// -Pi y.
  template <Team TeamT, class Real, int kStride>
  static STICTION_HD void right_side(TeamT& team, DenseSystem<Real, kStride>& s) {
    const auto loose = s.vector(kFree);
    const auto normal = s.vector(kNormal);
    const auto step = s.vector(kStep);
    s.for_each_cone(team, [&](auto shape, Index, Index row) {
      constexpr int kRows = decltype(shape)::kRows;
      Real part(0);
      for (int k = 0; k < kRows; ++k) part = fma_(normal[row + k], s.y[row + k], part);
      for (int k = 0; k < kRows; ++k) {
        const Real sticks = Real(0) - loose[row + k] * s.y[row + k];
        step[row + k] = kRows > 1 ? fma_(normal[row + k], part, sticks) : sticks;
      }
    });
  }

  /// x plus the step, on the cones.
  template <Team TeamT, class Real, int kStride>
  static STICTION_HD void project_step(TeamT& team, DenseSystem<Real, kStride>& s, Mask<Real> steps) {
    const auto step = s.vector(kStep);
    const auto kept = s.vector(kKeptX);
    s.for_each_cone(team, [&](auto shape, Index cone, Index row) {
      constexpr int kRows = decltype(shape)::kRows;
      Real z[kRows];
      Real still[kRows];
      for (int k = 0; k < kRows; ++k) {
        z[k] = s.x[row + k] + step[row + k];
        still[k] = Real(0);
      }
      proximal_point(shape, z, still, Real(0), s.lo[cone], s.hi[cone], Law::convex);
      for (int k = 0; k < kRows; ++k) s.x[row + k] = select(steps, z[k], kept[row + k]);
    });
  }
};

}  // namespace stiction::inline STICTION_ISA
