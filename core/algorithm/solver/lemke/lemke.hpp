#pragma once

#include "core/algorithm/solver/lemke/pair_start.hpp"
#include "core/algorithm/solver/method.hpp"
#include "core/algorithm/sweep/sweep.hpp"

namespace stiction::inline STICTION_ISA {

/// Lemke's complementary pivoting with bounds, for environments without friction cones but those of boxed friction
/// (docs/math/lemke.md). An iteration is a pivot, the number of pivots is finite, and the path ends at a solution or on
/// a ray. For a positive semidefinite A without friction a ray means that there is none. When a path has ended the
/// dictionary of its last basis is written anew from the system's numbers. No rounding of the pivots is hence left. A
/// remaining infeasibility is the beginning of another path.
struct Lemke {
  static constexpr SolverKind kKind = SolverKind::lemke;
  static STICTION_HD constexpr Workspace workspace() { return {.f64_vectors = kPivotVectors, .dense_matrices = 1}; }
  /// A pivot costs as much as a check of the residual.
  static constexpr Index kChunk = 8;
  static constexpr double kPaths = 4.0;     ///< begun at most
  static constexpr double kRays = 2.0;      ///< met before paths begin elsewhere
  static constexpr double kRestarts = 8.0;  ///< begun elsewhere at most, and at most one for each row
  static constexpr double kLongPath = 3.0;  ///< pivots for each row before a path is begun anew
  static constexpr double kGoldenRatio = 0.61803398874989485;
  static constexpr double kFeasible = 1e-11;  ///< of the largest value
  static constexpr float kFarBound = 0x1p20F;
  static STICTION_HD constexpr bool needs_symmetry(Law) { return false; }
  static constexpr bool kTakesAnyDiagonal = true;
  static constexpr bool kTakesBoxFriction = true;
  template <class System>
  static constexpr bool kKeepsMotion = false;

  /// State between pivots.
  enum State : Index { kEntering, kPathsBegun, kRaysMet, kPivots };

  template <class System>
  static STICTION_HD std::uint32_t unsupported(const System& s) {
    const auto& counts = counts_of(s);
    Index friction = 0;
    for (Index m = 2; m <= kMaxConeRows; ++m) friction += counts.friction[m];
    if (friction > counts.box_friction) return kFlagUnsupportedCone;
    return pairs_fit(s.n, s.n - s.cones) ? 0U : kFlagOverCapacity;
  }

  template <Law kLaw, Team TeamT, class System>
  static STICTION_HD_OUTLINE void start(TeamT& team, System& s) {
    const Tableau t(s);
    single(team, [&] { t.state[kPathsBegun] = t.state[kRaysMet] = t.state[kPivots] = 0.0; });
    // Boxes start at the bound that b pushes them to, equalities are solved for. A far bound is no place to start
    // from: sums there lose the digits of b.
    s.for_each_cone(team, [&](auto shape, Index cone, Index row) {
      constexpr ConeKind kConeKind = decltype(shape)::kKind;
      double side = 1.0;
      bool is_free = kConeKind == ConeKind::free;
      if constexpr (kConeKind == ConeKind::box) {
        const bool lower = is_near(s.lo[cone]);
        const bool upper = is_near(s.hi[cone]);
        side = lower && (!upper || !(s.b[row] < 0)) ? 1.0 : -1.0;
        if (!(s.lo[cone] < s.hi[cone])) side = 0.0;
        is_free = !lower && !upper && s.lo[cone] < s.hi[cone];
      }
      t.side[row] = is_free ? 0.0 : side;
      t.ratio[row] = is_free ? 1.0 : 0.0;
    });
    if (t.n > s.n) find_axes(team, s, t);
    weigh_bare_rows(team, s, t);
    begin_path(team, s, t, false);
  }

  template <Law kLaw, Team TeamT, class System>
  static STICTION_HD_OUTLINE void iterate(TeamT& team, System& s, const MethodParams<Scalar<typename System::Real>>&) {
    if (s.scalar[kOutcome] != static_cast<typename System::Real>(kRunning)) return;
    const Tableau t(s);
    const auto entering = static_cast<Index>(t.state[kEntering]);
    if (entering == t.artificial()) {
      open_path(team, s, t);
    } else {
      follow_path(team, s, t, entering);
    }
    write_iterate(team, s, t);
  }

  template <Team TeamT, class System>
  static STICTION_HD void refresh(TeamT&, System&, Mask<typename System::Real>) {}

 private:
  /// Returns true if a bound is one to start from. The largest of b and of the diagonal are about 1.
  template <class Real>
  static STICTION_HD bool is_near(Real bound) {
    return abs_(bound) < Real(kFarBound);
  }
  template <class System>
  static STICTION_HD const ConeCounts& counts_of(const System& s) {
    if constexpr (requires { s.counts; }) {
      return s.counts;
    } else {
      return s.env->counts;
    }
  }

  /// Gives reactions of rows without a positive diagonal the weight of the row's largest entry, as the final residual
  /// does. No other method is given such rows. An iterate that was recorded without it is no candidate.
  template <Team TeamT, class System>
  static STICTION_HD_OUTLINE void weigh_bare_rows(TeamT& team, const System& s, const Tableau& t) {
    using Real = typename System::Real;
    std::uint32_t found = 0;
    s.for_each_cone(team, [&](auto, Index cone, Index) {
      if (!(s.press[cone] > Real(0))) found = 1;
    });
    if (team.combine(found) == 0) return;
    write_matrix(team, s, t);
    s.for_each_cone(team, [&](auto, Index cone, Index row) {
      if (s.press[cone] > Real(0)) return;
      double largest = 0.0;
      for (Index j = 0; j < s.n; ++j) largest = max_(abs_(t.T(row, 2 + j)), largest);
      s.press[cone] = static_cast<Real>(largest);
    });
    single(team, [&] { s.scalar[kBestResidual] = static_cast<Real>(__builtin_huge_valf()); });
  }

  /// Rays after which the last one is believed.
  static STICTION_HD double most_rays(const Tableau& t) { return kRays + min_(kRestarts, static_cast<double>(t.n)); }

  /// The dictionary in which the x_j with t.ratio[j] = 1 are basic, and z0's column. A variable between two bounds has
  /// no entry there: if it has left them it goes to rest at the one it passed. After `kRays` rays a path that begins
  /// `anew` does so as one of Lemke and Howson's, with labels spread over the rows.
  template <Team TeamT, class System>
  static STICTION_HD_OUTLINE void begin_path(TeamT& team, const System& s, const Tableau& t, bool anew) {
    write_dictionary(team, s, t);
    write_values(team, s, t);
    bring_in(team, t, t.ratio);
    for (Index row = 0; row < t.n; ++row) {
      const Index x = t.variable_of(row);
      if (x >= t.n || !finite_(t.lo[x]) || !finite_(t.hi[x])) continue;
      const double value = t.value(row);
      const Index y = t.n + x;
      const double bound = clamp_(value, t.lo[x], t.hi[x]);
      if (value == bound || t.is_basic(y) || !(abs_(t.T(row, t.column_of(y))) > Tableau::kRelativePivot)) continue;
      exchange(team, t, row, y, div_(bound - value, t.T(row, t.column_of(y))));
      single(team, [&] { t.side[x] = value < t.lo[x] ? 1.0 : -1.0; });
    }
    const double restart = t.state[kRaysMet] - kRays;
    Index label = -1;
    if (anew && restart >= 0.0) {
      const double step = div_(static_cast<double>(t.n), most_rays(t) - kRays);
      label = static_cast<Index>(restart * step);
      if (label >= t.n || !begin_at_pair(team, t, label)) label = -1;
    }
    cover(team, t, label);
    single(team, [&] { t.state[kEntering] = static_cast<double>(t.artificial()); });
  }

  /// z0's column is positive where a basic variable has a lower bound only, negative where it has an upper one only.
  /// A large z0 thus makes every row feasible. With a label it is the column of y_label wherever that one lifts a row,
  /// and covers no row that needs no covering.
  template <Team TeamT>
  static STICTION_HD_OUTLINE void cover(TeamT& team, const Tableau& t, Index label) {
    const double paths = t.state[kPathsBegun];
    const Index column = label < 0 ? 0 : t.column_of(t.n + label);
    const double noise = kFeasible * max_over<double>(team, t.n, [&](Index i) { return abs_(t.value(i)); });
    for_each(team, t.n, [&](Index i) {
      const Index variable = t.variable_of(i);
      const bool lower = finite_(t.lower(variable));
      const bool upper = finite_(t.upper(variable));
      const double turns = paths * static_cast<double>(i + 1) * kGoldenRatio;
      const double weight = 1.0 + (turns - static_cast<double>(static_cast<Index>(turns)));
      const double sign = lower == upper ? 0.0 : lower ? 1.0 : -1.0;
      double entry = weight;
      if (label >= 0) {
        const bool is_feasible = !(max_(t.lower(variable) - t.value(i), t.value(i) - t.upper(variable)) > noise);
        const double lift = sign * t.T(i, column);
        entry = lift > Tableau::kRelativePivot ? lift : is_feasible ? 0.0 : weight;
      }
      t.T(i, 1) = sign * entry;
    });
  }

  template <Team TeamT, class System>
  static STICTION_HD_OUTLINE void end(TeamT& team, System& s, Outcome outcome) {
    single(team, [&] { s.scalar[kOutcome] = static_cast<typename System::Real>(outcome); });
  }

  /// The complement of the leaving variable enters next.
  template <Team TeamT>
  static STICTION_HD_OUTLINE void enter_next(TeamT& team, const Tableau& t, Index leaving) {
    single(team, [&] { t.state[kEntering] = static_cast<double>(leaving < t.n ? leaving + t.n : leaving - t.n); });
  }

  /// Returns the bound at which x rests when it leaves the basis.
  template <Team TeamT>
  static STICTION_HD_OUTLINE void note_side(TeamT& team, const Tableau& t, Index leaving, bool at_lower) {
    single(team, [&] {
      if (leaving < t.n) t.side[leaving] = at_lower ? 1.0 : -1.0;
    });
  }

  /// Ends if the dictionary's own solution is feasible or enough paths have been tried; else z0 enters, as large as the
  /// worst row needs it.
  template <Team TeamT, class System>
  static STICTION_HD_OUTLINE void open_path(TeamT& team, System& s, const Tableau& t) {
    const double size = max_over<double>(team, t.n, [&](Index i) { return abs_(t.value(i)); });
    const double violation = max_over<double>(team, t.n, [&](Index i) {
      const Index variable = t.variable_of(i);
      return max_(t.lower(variable) - t.value(i), t.value(i) - t.upper(variable));
    });
    const double paths = t.state[kPathsBegun];
    const double rays = t.state[kRaysMet];
    if (!(violation > kFeasible * size)) {
      end(team, s, kFinished);
    } else if (rays >= most_rays(t)) {
      end(team, s, kRayDetected);
    } else {
      const Blocking worst = first_blocking(team, t, t.artificial(), -1.0, true);
      if (paths >= kPaths + max_(rays - kRays, 0.0) || !(worst.step < 0.0)) {
        end(team, s, kGaveUp);
        return;
      }
      const Index leaving = t.variable_of(worst.row);
      const bool at_lower = t.T(worst.row, 1) > 0.0;
      exchange(team, t, worst.row, t.artificial(), 0.0 - worst.step);
      note_side(team, t, leaving, at_lower);
      single(team, [&] {
        t.state[kPathsBegun] = paths + 1.0;
        t.state[kPivots] = 0.0;
      });
      enter_next(team, t, leaving);
    }
  }

  template <Team TeamT, class System>
  static STICTION_HD_OUTLINE void follow_path(TeamT& team, System& s, const Tableau& t, Index entering) {
    const Index pair = entering < t.n ? entering : entering - t.n;
    const double direction = t.side[pair];
    const Index c = t.column_of(entering);
    // Elimination leaves a pair basic twice, and another not at all, where the entry after a pivot off the diagonal is
    // rounding. No path leads on from there, and none has ended on a ray.
    const bool is_broken = t.is_basic(entering);
    const Blocking next =
        is_broken ? Blocking{Blocking::kNothing, 0.0} : first_blocking(team, t, entering, direction, false);
    if (next.row == t.n) {
      // x has crossed from one bound to the other before anything else blocked.
      for_each(team, t.n, [&](Index i) { t.value(i) = fma_(t.T(i, c), direction * next.step, t.value(i)); });
      note_side(team, t, entering, direction < 0.0);
      enter_next(team, t, entering);
      return;
    }
    const double pivots = t.state[kPivots] + 1.0;
    const double rays = t.state[kRaysMet];
    const bool is_elsewhere = rays >= kRays;
    const bool may_leave = is_elsewhere ? rays + 1.0 < most_rays(t) : t.state[kPathsBegun] < kPaths;
    const bool is_long = pivots > kLongPath * static_cast<double>(t.n) && may_leave;
    Index leaving = Blocking::kNothing;
    if (next.row != Blocking::kNothing) {
      leaving = t.variable_of(next.row);
      const bool at_lower = direction * t.T(next.row, c) < 0.0;
      exchange(team, t, next.row, entering, direction * next.step);
      single(team, [&] { t.state[kPivots] = pivots; });
      if (leaving != t.artificial() && !is_long) {
        note_side(team, t, leaving, at_lower);
        enter_next(team, t, leaving);
        return;
      }
    }
    // Begins after a ray, with another covering vector. If A is not semidefinite the ray belongs to the path and not
    // to the problem. One of the paths begun elsewhere that does not end is left like a ray.
    const bool anew = leaving == Blocking::kNothing || (is_elsewhere && leaving != t.artificial());
    for_each(team, t.n, [&](Index j) {
      const bool is_free = !is_near(t.lo[j] * t.unit[j]) && !is_near(t.hi[j] * t.unit[j]) && t.lo[j] < t.hi[j];
      t.ratio[j] = (anew ? is_free : t.is_basic(j)) ? 1.0 : 0.0;
      if (anew && is_free) t.side[j] = 0.0;
    });
    single(team, [&] {
      if (anew && !is_broken) t.state[kRaysMet] = rays + 1.0;
    });
    begin_path(team, s, t, anew);
  }

  /// The dictionary's own solution, clipped to the bounds. Axes are counted from their lower bounds no more.
  template <Team TeamT, class System>
  static STICTION_HD_OUTLINE void write_iterate(TeamT& team, System& s, const Tableau& t) {
    using Real = typename System::Real;
    const auto number = [&](Index j) {
      const double x = t.is_basic(j) ? clamp_(t.value(t.row_of(j)), t.lo[j], t.hi[j]) : t.rest(j);
      return x * t.unit[j];
    };
    for_each(team, s.n, [&](Index j) { s.x[j] = static_cast<Real>(number(j)); });
    if (t.n == s.n) return;
    for_each(team, t.n - s.n, [&](Index a) {
      const Index axis = t.axis_of(s.n + a);
      const double normal = number(t.normal_of(axis));
      s.x[axis] = static_cast<Real>(clamp_(number(axis) - normal, 0.0 - normal, normal));
    });
  }
};

}  // namespace stiction::inline STICTION_ISA
