#pragma once

#include "core/algorithm/solver/lemke/tableau.hpp"

namespace stiction::inline STICTION_ISA {

/// Element that ends a variable's way: a row of the dictionary, or the variable's own other bound.
struct Blocking {
  static constexpr Index kNothing = -1;
  Index row;    ///< the row; n for the variable itself; or kNothing
  double step;  ///< how far it gets
};

/// Dependence of a step ending at `row` on the perturbation e of y_j: the coefficient of e^j in its length.
STICTION_HD double perturbed_step(const Tableau& t, Index row, Index j, Index c, double direction) {
  if (row == t.n) return 0.0;
  const Index y = t.n + j;
  const double value = t.is_basic(y) ? (t.row_of(y) == row ? 1.0 : 0.0) : 0.0 - t.T(row, t.column_of(y));
  return div_(0.0 - value, direction * t.T(row, c));
}

/// True if step b is lexicographically shorter than a, both tied in length. Coefficients apart by rounding are equal.
STICTION_HD bool is_shorter(const Tableau& t, Index b, Index a, Index c, double direction) {
  constexpr double kEqual = 1e-9;
  for (Index j = 0; j < t.n; ++j) {
    const double of_a = perturbed_step(t, a, j, c, direction);
    const double of_b = perturbed_step(t, b, j, c, direction);
    const double scale = max_(max_(abs_(of_a), abs_(of_b)), 1.0);
    if (abs_(of_a - of_b) > kEqual * scale) return of_b < of_a;
  }
  return false;
}

/// The lexicographic ratio test (Cottle, Pang, Stone 1992, section 4.9): `entering` moves in `direction` from where it
/// rests until a basic variable meets a bound. Rows whose bounds are met within rounding of one another are tied; z0
/// wins a tie, then the lexicographically shortest step. Entries below rounding of their column do not block. A path's
/// first step (`opening`) comes from infinity and may therefore be negative.
template <Team TeamT>
STICTION_HD_OUTLINE Blocking first_blocking(TeamT& team, const Tableau& t, Index entering, double direction,
                                            bool opening) {
  constexpr double kTie = 1e-13;
  const double infinite = __builtin_huge_val();
  const Index n = t.n;
  const Index c = t.column_of(entering);
  const double largest = max_over<double>(team, n, [&](Index i) { return abs_(t.T(i, c)); });
  const double size = max_over<double>(team, n, [&](Index i) { return abs_(t.value(i)); });
  const double floor = Tableau::kRelativePivot * largest;
  double shortest = infinite;
  for (Index i = team.rank(); i < n; i += team.size()) {
    const double slope = direction * t.T(i, c);
    const Index variable = t.variable_of(i);
    const double bound = slope < 0.0 ? t.lower(variable) : t.upper(variable);
    double step = infinite;
    if (abs_(slope) > floor && finite_(bound)) {
      step = div_(bound - t.value(i), slope);
      if (!opening && !(step > 0.0)) step = 0.0;
    }
    t.ratio[i] = step;
    shortest = min_(step, shortest);
  }
  const double workspace = opening || entering >= n ? infinite : t.hi[entering] - t.lo[entering];
  shortest = min_(workspace, 0.0 - team.max(0.0 - shortest));
  if (!(shortest < infinite)) return {Blocking::kNothing, infinite};

  const auto is_tied = [&](Index i) {
    // If numbers overflow the size is infinite, too; that ties nothing with a bound that is not there.
    if (i == n) return workspace < infinite && (workspace - shortest) <= kTie * size;
    return t.ratio[i] < infinite && (t.ratio[i] - shortest) * abs_(t.T(i, c)) <= kTie * size;
  };
  double lowest = infinite;
  double highest = 0.0 - infinite;
  for (Index i = team.rank(); i <= n; i += team.size())
    if (is_tied(i)) {
      lowest = min_(static_cast<double>(i), lowest);
      highest = max_(static_cast<double>(i), highest);
    }
  lowest = 0.0 - team.max(0.0 - lowest);
  highest = team.max(highest);
  if (!(lowest < infinite)) return {Blocking::kNothing, infinite};
  Index row = static_cast<Index>(lowest);
  if (lowest < highest) {
    row = team.broadcast([&] {
      Index best = static_cast<Index>(lowest);
      for (Index i = best; i <= n; ++i) {
        if (!is_tied(i)) continue;
        if (i < n && t.variable_of(i) == t.artificial()) return i;
        if (i != best && is_shorter(t, i, best, c, direction)) best = i;
      }
      return best;
    });
  }
  return {row, row == n ? workspace : t.ratio[row]};
}

}  // namespace stiction::inline STICTION_ISA
