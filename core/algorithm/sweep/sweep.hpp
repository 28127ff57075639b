#pragma once

#include <type_traits>

#include "core/algorithm/sweep/block_visit.hpp"
#include "core/algorithm/sweep/local_solve.hpp"
#include "core/algorithm/system/dense_system.hpp"
#include "core/algorithm/system/factor_system.hpp"
#include "core/algorithm/system/sparse_system.hpp"
#include "core/algorithm/system/system_pair.hpp"

namespace stiction::inline STICTION_ISA {

/// The largest |d_k| of a cone's change.
template <class Real, int M>
STICTION_HD Real largest_of(const ConeStep<Real, M>& step) {
  Real largest = abs_(step.d[0]);
  for (int k = 1; k < M; ++k) largest = max_(abs_(step.d[k]), largest);
  return largest;
}
/// Size of a cone's change in units of w: that times the cone's mean diagonal.
template <class Real, int M>
STICTION_HD Real step_size(const ConeStep<Real, M>& step, Real weight) {
  return largest_of(step) * weight;
}

/// Step of a sweep at a cone by default: that of docs/math/local_solve.md.
struct DefaultLocalStep {
  template <Law kLaw, class Shape, class System>
  static STICTION_HD auto of(Shape shape, const System& s, Index cone, Index row,
                             const typename System::Real (&y)[Shape::kRows], typename System::Real omega) {
    return local_step<kLaw>(shape, s, cone, row, y, omega);
  }
};

/// Moves x of one cone whose motion is maintained. Returns the step that is still to be pushed by push().
template <Law kLaw, class Local, class Shape, class System>
STICTION_HD auto move_cone(Shape shape, System& s, Index cone, Index row, typename System::Real omega) {
  typename System::Real y[Shape::kRows];
  for (int r = 0; r < Shape::kRows; ++r) y[r] = s.y[row + r];
  const auto step = Local::template of<kLaw>(shape, s, cone, row, y, omega);
  for (int r = 0; r < Shape::kRows; ++r) s.x[row + r] = s.x[row + r] + step.d[r];
  return step;
}

/// Pushes a cone's change into all of y. Returns its size.
template <int M, Team TeamT, class System>
STICTION_HD auto push_step(TeamT& team, System& s, Index cone, Index row,
                           const ConeStep<typename System::Real, M>& step) {
  using Real = typename System::Real;
  const Real largest = largest_of(step);
  // A cone that does not move, an open contact above all, pushes nothing. Its size does not show it. A small change
  // times a small diagonal can be zero, and its push must not depend on other lanes.
  if (any(largest != Real(0))) s.push(team, row, step.d);
  return largest * s.residual_weight[cone];
}

/// Motion of a block's rows: the largest change, and in units of w.
template <class Real>
struct BlockStep {
  Real largest, size;
};

/// Visits the cones of a window as a block: several times, pushing changes into the block's own motion alone. `d` gets
/// the changes of its rows, which are still to be pushed into all other motion.
template <Law kLaw, class Local, class Shape, class System>
STICTION_HD auto move_window(Shape shape, System& s, Index count, Index cone, Index row, typename System::Real omega,
                             typename System::Real* d) {
  using Real = typename System::Real;
  constexpr int kRows = Shape::kRows;
  const Index end = row + count * kRows;
  for (Index r = row; r < end; ++r) d[r - row] = s.x[r];
  for (Index visit = 0; visit < kBlockVisits; ++visit)
    for (Index c = 0; c < count; ++c) {
      const Index own = row + c * kRows;
      const auto step = move_cone<kLaw, Local>(shape, s, cone + c, own, omega);
      s.template push_rows<kRows>(row, end, own, step.d);
    }
  BlockStep<Real> step{Real(0), Real(0)};
  for (Index c = 0; c < count; ++c) {
    Real moved(0);
    for (Index r = c * kRows; r < (c + 1) * kRows; ++r) {
      d[r] = s.x[row + r] - d[r];
      moved = max_(abs_(d[r]), moved);
    }
    step.largest = max_(moved, step.largest);
    step.size = max_(moved * s.residual_weight[cone + c], step.size);
  }
  return step;
}

/// One right-looking sweep by blocks. A block's cones are neighbours in canonical order, in which the plan has put
/// strongly coupled ones side by side (docs/math/pgs.md, "Blocks of cones").
template <Law kLaw, class Local, Team TeamT, class System>
STICTION_HD_OUTLINE auto sweep_in_blocks(TeamT& team, System& s, typename System::Real omega) {
  using Real = typename System::Real;
  Real largest(0);
  Real own[kMostBlockRows];
  Real* d = own;
  if constexpr (!std::is_same_v<TeamT, SerialTeam>)
    if (team.size() > 1) d = team.template leaves<Real>();
  s.for_each_window([&](auto shape, Index count, Index cone, Index row) {
    const auto step = team.broadcast([&] { return move_window<kLaw, Local>(shape, s, count, cone, row, omega, d); });
    if (any(step.largest != Real(0))) s.template push_window<decltype(shape)::kRows>(team, count, row, d);
    largest = max_(step.size, largest);
  });
  return largest;
}

/// One right-looking Gauss-Seidel sweep: cones in canonical order, each one's change pushed into all of y before the
/// next is visited. Returns the largest step size, on every lane.
template <Law kLaw, class Local = DefaultLocalStep, Team TeamT, class System>
  requires System::kMaintainsMotion
STICTION_HD auto sweep(TeamT& team, System& s, typename System::Real omega) {
  using Real = typename System::Real;
  if constexpr (requires { requires System::kTakesBlocks; })
    if (s.has_blocks) return sweep_in_blocks<kLaw, Local>(team, s, omega);
  Real largest(0);
  s.for_each_in_order([&](auto shape, Index cone, Index row) {
    const auto step = team.broadcast([&] { return move_cone<kLaw, Local>(shape, s, cone, row, omega); });
    largest = max_(push_step(team, s, cone, row, step), largest);
  });
  return largest;
}

/// One sweep of two packs.
template <Law kLaw, class Local = DefaultLocalStep, Team TeamT, class System>
STICTION_HD auto sweep(TeamT& team, SystemPair<System>& s, typename System::Real omega) {
  using Real = typename System::Real;
  if (s.a.has_blocks)
    return NumberPair<Real>{sweep_in_blocks<kLaw, Local>(team, s.a, omega),
                            sweep_in_blocks<kLaw, Local>(team, s.b, omega)};
  NumberPair<Real> largest{Real(0), Real(0)};
  s.a.for_each_in_order([&](auto shape, Index cone, Index row) {
    const auto step_a = move_cone<kLaw, Local>(shape, s.a, cone, row, omega);
    const auto step_b = move_cone<kLaw, Local>(shape, s.b, cone, row, omega);
    largest.a = max_(push_step(team, s.a, cone, row, step_a), largest.a);
    largest.b = max_(push_step(team, s.b, cone, row, step_b), largest.b);
  });
  return largest;
}

/// Makes one coloured Gauss-Seidel sweep. The vertices of a colour share no entry of A and are visited at once. The
/// cones of a vertex (one manifold) are visited one after the other, or as a block. Returns the largest step size, on
/// every lane.
template <Law kLaw, class Local = DefaultLocalStep, Team TeamT, class RealType>
STICTION_HD RealType sweep(TeamT& team, SparseSystem<RealType>& s, RealType omega) {
  using Real = RealType;
  const EnvView<Real>& env = *s.env;
  Real largest(0);
  for (Index color = 0; color < env.color_count; ++color) {
    const Index first = env.color_offsets[color];
    for_each(team, env.color_offsets[color + 1] - first, [&](Index k) {
      const Index begin = env.vertex_offsets[first + k], end = env.vertex_offsets[first + k + 1];
      if (env.block_visits > 1 && end - begin > 1 && visit_block<kLaw, Local>(s, begin, end, omega, largest)) return;
      for (Index p = begin; p < end; ++p) {
        const Index cone = env.cone_order[p];
        const Index row = env.cone_row(cone);
        with_shape(env.kind[cone], env.cone_size(cone), [&](auto shape) {
          constexpr int kRows = decltype(shape)::kRows;
          Real y[kRows];
          for (int r = 0; r < kRows; ++r) y[r] = s.gather(row + r, s.x, fma_(s.R[row + r], s.x[row + r], s.b[row + r]));
          const auto step = Local::template of<kLaw>(shape, s, cone, row, y, omega);
          for (int r = 0; r < kRows; ++r) s.x[row + r] = s.x[row + r] + step.d[r];
          largest = max_(step_size(step, s.residual_weight[cone]), largest);
        });
      }
    });
  }
  return team.max(largest);
}

/// Makes one Gauss-Seidel sweep through the velocity. It visits cones in file order. Each one's motion is read from u
/// and its change pushed into u before the next is visited. u is recomputed at the beginning, so whatever moved x
/// since (momentum) costs no thought and rounding does not pile up. Returns the largest step size, on every lane.
template <Law kLaw, class Local = DefaultLocalStep, Team TeamT, class RealType>
STICTION_HD RealType sweep(TeamT& team, FactorSystem<RealType>& s, RealType omega) {
  using Real = RealType;
  const EnvView<Real>& env = *s.env;
  Real largest(0);
  s.project(team, s.x);
  for (Index cone = 0; cone < s.cones; ++cone) {
    const Index row = env.cone_row(cone);
    with_shape(env.kind[cone], env.cone_size(cone), [&](auto shape) {
      constexpr int kRows = decltype(shape)::kRows;
      Real own[kRowParts * kRows];
      Real* part = own;
      if (team.size() == 1) {
        for (int r = 0; r < kRows; ++r) s.partials(row + r, own + r * kRowParts);
      } else {
        part = team.template leaves<Real>();
        for_each(team, kRowParts * kRows,
                 [&](Index leaf) { part[leaf] = s.partial(row + leaf / kRowParts, leaf % kRowParts); });
      }
      const ConeStep<Real, kRows> step = team.broadcast([&] {
        Real y[kRows];
        for (int r = 0; r < kRows; ++r)
          y[r] = s.fold(part + r * kRowParts, fma_(s.R[row + r], s.x[row + r], s.b[row + r]));
        const auto local = Local::template of<kLaw>(shape, s, cone, row, y, omega);
        for (int r = 0; r < kRows; ++r) s.x[row + r] = s.x[row + r] + local.d[r];
        return local;
      });
      largest = max_(push_step(team, s, cone, row, step), largest);
    });
  }
  return largest;
}

/// sweep() under a law that is known at run time, which all solvers on one kind of team have in common.
template <Law kLaw, Team TeamT, class System>
STICTION_HD_PART typename System::Real common_sweep(TeamT& team, System& s, typename System::Real omega) {
  return sweep<kLaw>(team, s, omega);
}
template <Law kLaw, Team TeamT, class System>
STICTION_HD auto sweep_by_law(TeamT& team, System& s, typename System::Real omega) {
  if constexpr (kLaw == kLawOfSystem) {
    return with_law<kLaw>(s, [&](auto law) { return common_sweep<decltype(law)::value>(team, s, omega); });
  } else {
    return sweep<kLaw>(team, s, omega);
  }
}

/// Iterations after which maintained motion is recomputed, so that rounding does not pile up in it.
inline constexpr Index kRefreshInterval = 16;

/// y = (A + diag R) x + b from scratch.
template <Team TeamT, class System>
STICTION_HD void refresh_motion(TeamT& team, System& s) {
  using Real = typename System::Real;
  s.multiply(team, s.x, [&](Index i) { return s.b[i]; }, [&](Index i, Real motion) { s.y[i] = motion; });
}

/// Fresh motion in the lanes of `due`.
template <Team TeamT, class System>
STICTION_HD void refresh_motion(TeamT& team, System& s, Mask<typename System::Real> due) {
  using Real = typename System::Real;
  s.multiply(
      team, s.x, [&](Index i) { return s.b[i]; }, [&](Index i, Real motion) { s.y[i] = select(due, motion, s.y[i]); });
}

/// Fresh motion where y is extrapolated along y - y_before: the correction goes into both. Corrected alone, y would
/// jump relative to y_before, and momentum would multiply that jump until the next refresh multiplies it again.
template <Team TeamT, class System, class Vector>
STICTION_HD void refresh_motion(TeamT& team, System& s, Mask<typename System::Real> due, Vector y_before) {
  using Real = typename System::Real;
  s.multiply(
      team, s.x, [&](Index i) { return s.b[i]; },
      [&](Index i, Real motion) {
        y_before[i] = select(due, y_before[i] + (motion - s.y[i]), y_before[i]);
        s.y[i] = select(due, motion, s.y[i]);
      });
}

}  // namespace stiction::inline STICTION_ISA
