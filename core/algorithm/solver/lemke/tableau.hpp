#pragma once

#include "core/algorithm/linear/dense/fill_matrix.hpp"
#include "core/job/pivot_pairs.hpp"
#include "core/team/reduce.hpp"

/// The dictionary of complementary pivoting (docs/math/lemke.md): n basic variables as affine functions of n + 1
/// non-basic ones, kept by a team. Every entry is computed by one lane from the pivot's row and column alone. The bits
/// hence do not depend on how many lanes there are. n is the number of pairs (core/job/pivot_pairs.hpp): the rows of
/// the system, and behind them one for each axis of boxed friction.
namespace stiction::inline STICTION_ISA {

/// Variables are numbered: x_j is j, y_j is n + j, the artificial z0 is 2n. In a pair x_j, y_j the one that is not
/// basic rests: y_j at 0, x_j at the bound that side[j] names.
struct Tableau {
  static constexpr Index kVectors = kPairVectors;  ///< of n doubles before the n x n entries
  static constexpr double kRelativePivot = 1e-10;

  Index n;
  double* unit;    ///< power of two that row and column j were multiplied by                       (n)
  double* lo;      ///< bounds of x_j, -infinity and infinity included                             (n)
  double* hi;      ///<                                                                            (n)
  double* side;    ///< 1: x_j rests at lo, y_j >= 0; -1: at hi, y_j <= 0; 0: y_j may have any sign  (n)
  double* basic;   ///< the variable of each row                                                   (n)
  double* place;   ///< where x_j, y_j are: row r >= 0, or -1 - c for column c                     (2n)
  double* column;  ///< the pivot's column                                                         (n)
  double* ratio;   ///< step at which each row blocks; before that which x_j are wanted            (n)
  double* state;   ///< state of the method                                                        (4)
  double* base;    ///< with axes: of an axis its normal row, of the pair that holds it the axis   (n)
  DenseMatrix T;   ///< values of the basic variables, z0's column, the pairs' columns             (n * (n + 2))

  template <class System>
  explicit STICTION_HD Tableau(const System& s)
      : n(2 * s.n - s.cones),
        unit(s.wide_vector(0, n)),
        lo(s.wide_vector(1, n)),
        hi(s.wide_vector(2, n)),
        side(s.wide_vector(3, n)),
        basic(s.wide_vector(4, n)),
        place(s.wide_vector(5, n)),
        column(s.wide_vector(7, n)),
        ratio(s.wide_vector(8, n)),
        state(s.wide_vector(9, n)),
        base(s.wide_vector(11, n)),  // behind the state where there are three pairs, as there are with an axis
        T{s.wide_vector(kVectors - 2, n), n} {}

  [[nodiscard]] STICTION_HD Index artificial() const { return 2 * n; }
  [[nodiscard]] STICTION_HD Index variable_of(Index row) const { return static_cast<Index>(basic[row]); }
  [[nodiscard]] STICTION_HD bool is_basic(Index variable) const { return place[variable] >= 0.0; }
  /// Row of a basic variable.
  [[nodiscard]] STICTION_HD Index row_of(Index variable) const { return static_cast<Index>(place[variable]); }
  /// Column of a variable that is not; z0 enters from its own.
  [[nodiscard]] STICTION_HD Index column_of(Index variable) const {
    return variable == artificial() ? 1 : static_cast<Index>(-1.0 - place[variable]);
  }
  [[nodiscard]] STICTION_HD double& value(Index row) const { return T(row, 0); }
  /// Row of an axis that the pair `held` holds at its upper bound, and the normal row of an axis.
  [[nodiscard]] STICTION_HD Index axis_of(Index held) const { return static_cast<Index>(base[held]); }
  [[nodiscard]] STICTION_HD Index normal_of(Index axis) const { return static_cast<Index>(base[axis]); }

  [[nodiscard]] STICTION_HD double lower(Index variable) const {
    if (variable < n) return lo[variable];
    return variable < artificial() && side[variable - n] <= 0.0 ? 0.0 - __builtin_huge_val() : 0.0;
  }
  [[nodiscard]] STICTION_HD double upper(Index variable) const {
    if (variable < n) return hi[variable];
    return variable < artificial() && side[variable - n] < 0.0 ? 0.0 : __builtin_huge_val();
  }
  /// Value of a variable that is not basic.
  [[nodiscard]] STICTION_HD double rest(Index variable) const {
    if (variable >= n || (side[variable] == 0.0 && lo[variable] < hi[variable])) return 0.0;
    const double bound = side[variable] < 0.0 ? hi[variable] : lo[variable];
    return finite_(bound) ? bound : 0.0;
  }
};

/// The variable `entering` moves by `change` and takes the place of the basic variable of `row`.
template <Team TeamT>
STICTION_HD_OUTLINE void exchange(TeamT& team, const Tableau& t, Index row, Index entering, double change) {
  const Index n = t.n;
  const Index c = t.column_of(entering);
  const Index leaving = t.variable_of(row);
  const double pivot = t.T(row, c);
  const double arrived = t.rest(entering) + change;
  const Index columns = n + 2;
  for_each(team, columns, [&](Index k) {
    if (k < n) t.column[k] = t.T(k, c);
    if (k > 0 && k != c) t.T(row, k) = div_(0.0 - t.T(row, k), pivot);
  });
  // A zero of the pivot's row leaves its whole column as it is.
  const auto update = [&](Index i, Index k) {
    if (i != row) t.T(i, k) = fma_(t.column[i], t.T(row, k), t.T(i, k));
  };
  if (team.size() == 1) {
    for (Index k = 1; k < columns; ++k)
      if (k != c && t.T(row, k) != 0.0)
        for (Index i = 0; i < n; ++i) update(i, k);
  } else {
    for (Index i = team.rank(); i < n; i += team.size())
      for (Index k = 1; k < columns; ++k)
        if (k != c && t.T(row, k) != 0.0) update(i, k);
  }
  for_each(team, n, [&](Index i) {
    t.T(i, c) = i == row ? div_(1.0, pivot) : div_(t.column[i], pivot);
    t.value(i) = i == row ? arrived : fma_(t.column[i], change, t.value(i));
  });
  single(team, [&] {
    t.basic[row] = static_cast<double>(entering);
    if (entering != t.artificial()) t.place[entering] = static_cast<double>(row);
    if (leaving != t.artificial()) t.place[leaving] = -1.0 - static_cast<double>(c);
  });
}

/// Notes which pairs are axes. The pair that holds an axis is behind all rows, as many pairs on as there are axes
/// before.
template <Team TeamT, class System>
STICTION_HD_OUTLINE void find_axes(TeamT& team, const System& s, const Tableau& t) {
  s.for_each_cone(team, [&](auto shape, Index cone, Index row) {
    constexpr Index kRows = decltype(shape)::kRows;
    const Index held = s.n + (row - cone) - 1;
    for (Index k = 0; k < kRows; ++k) {
      t.base[row + k] = static_cast<double>(row);
      if (k > 0) t.base[held + k] = static_cast<double>(row + k);
    }
  });
  for_each(team, t.n - s.n, [&](Index a) {
    const Index held = s.n + a;
    const Index axis = t.axis_of(held);
    t.side[axis] = t.side[held] = 1.0;
    t.ratio[axis] = t.ratio[held] = 0.0;
  });
}

/// A + diag R, and zeros for the pairs of axes.
template <Team TeamT, class System>
STICTION_HD_OUTLINE void write_matrix(TeamT& team, const System& s, const Tableau& t) {
  const DenseMatrix M{&t.T(0, 2), t.n};
  if (t.n == s.n) return fill_matrix(team, s, M);
  if constexpr (requires { s.A; }) {
    for_each(team, s.n, [&](Index i) {
      for (Index j = 0; j < s.n; ++j) M(i, j) = static_cast<double>(s.A[i + s.n * j]);
    });
  } else {
    fill_matrix(team, s, M);
  }
  for_each(team, t.n, [&](Index i) {
    for (Index j = i < s.n ? s.n : 0; j < t.n; ++j) M(i, j) = 0.0;
  });
}

/// Boxed friction as half lines (docs/math/box_friction.md, equation 5), in coordinates in which an axis has the bounds
/// -x_n and x_n. The row of an axis is about p = x_k + x_n from here on, and v holds p at 2 x_n. v has the unit in
/// which its entry in the axis' row is 1.
template <Team TeamT, class System>
STICTION_HD_OUTLINE void write_axes(TeamT& team, const System& s, const Tableau& t) {
  for_each(team, s.n, [&](Index i) {
    for (Index held = s.n; held < t.n; ++held) {
      const Index axis = t.axis_of(held);
      double& entry = t.T(i, 2 + t.normal_of(axis));
      entry = entry - t.T(i, 2 + axis);
    }
  });
  for_each(team, t.n - s.n, [&](Index a) {
    const Index held = s.n + a;
    const Index axis = t.axis_of(held);
    t.T(axis, 2 + held) = 1.0;
    t.T(held, 2 + t.normal_of(axis)) = 2.0;
    t.T(held, 2 + axis) = -1.0;
    t.unit[held] = div_(1.0, t.unit[axis]);
    t.lo[axis] = t.lo[held] = 0.0;
    t.hi[axis] = t.hi[held] = __builtin_huge_val();
  });
}

/// Writes the dictionary in which every y is basic. It is y = M x + b in rows and columns scaled by powers of two to
/// diagonals of order one, x resting at its bounds.
template <Team TeamT, class System>
STICTION_HD_OUTLINE void write_dictionary(TeamT& team, const System& s, const Tableau& t) {
  const Index n = t.n;
  write_matrix(team, s, t);
  for_each(team, s.n, [&](Index i) {
    const double diagonal = t.T(i, 2 + i);
    t.unit[i] = diagonal > 0.0 ? unit_scale(sqrt_(diagonal)) : 1.0;
  });
  if (n > s.n) write_axes(team, s, t);
  s.for_each_cone(team, [&](auto shape, Index cone, Index row) {
    constexpr ConeKind kKind = decltype(shape)::kKind;
    const double infinite = __builtin_huge_val();
    const double inverse = div_(1.0, t.unit[row]);
    t.lo[row] = kKind == ConeKind::free  ? 0.0 - infinite
                : kKind == ConeKind::box ? static_cast<double>(s.lo[cone]) * inverse
                                         : 0.0;
    t.hi[row] = kKind == ConeKind::box ? static_cast<double>(s.hi[cone]) * inverse : infinite;
  });
  for_each(team, n, [&](Index i) {
    for (Index j = 0; j < n; ++j) t.T(i, 2 + j) = t.T(i, 2 + j) * (t.unit[i] * t.unit[j]);
    t.T(i, 1) = 0.0;
    t.basic[i] = static_cast<double>(n + i);
    t.place[i] = -3.0 - static_cast<double>(i);
    t.place[n + i] = static_cast<double>(i);
  });
}

/// The values of the basic y: b plus the contributions of x at rest.
template <Team TeamT, class System>
STICTION_HD_OUTLINE void write_values(TeamT& team, const System& s, const Tableau& t) {
  for_each(team, t.n, [&](Index i) {
    double sum = i < s.n ? static_cast<double>(s.b[i]) * t.unit[i] : 0.0;
    for (Index j = 0; j < t.n; ++j) {
      const double rest = t.rest(j);
      if (rest != 0.0) sum = fma_(t.T(i, 2 + j), rest, sum);
    }
    t.value(i) = sum;
  });
}

/// Makes the x_j with wanted[j] = 1 basic in place of the y_j, starting from the dictionary just written. It is
/// elimination with complete pivoting, a tie going to the diagonal. A row without a pivot above rounding is dependent
/// on those before it. Its x stays at rest, where a consistent system has y = 0.
template <Team TeamT>
STICTION_HD_OUTLINE void bring_in(TeamT& team, const Tableau& t, const double* wanted) {
  const Index n = t.n;
  double first = 0.0;
  for (Index step = 0; step < n; ++step) {
    const double none = 0.0 - __builtin_huge_val();
    double largest = 0.0;
    double key = none;  // minus the number of the pair, so that the first of several is the largest
    for (Index j = team.rank(); j < n; j += team.size()) {
      if (wanted[j] != 1.0 || t.is_basic(j)) continue;
      const Index c = t.column_of(j);
      for (Index i = 0; i < n; ++i) {
        if (wanted[i] != 1.0 || t.variable_of(i) != n + i) continue;
        const double entry = abs_(t.T(i, c));
        const double own = 0.0 - static_cast<double>(i == j ? i : n + j * n + i);
        if (entry > largest || (entry == largest && own > key)) {
          largest = entry;
          key = own;
        }
      }
    }
    const double found = team.max(largest);
    const double chosen = team.max(found > 0.0 && largest == found ? key : none);
    if (step == 0) first = found;
    if (!(found > Tableau::kRelativePivot * first)) return;
    const auto pair = static_cast<Index>(0.0 - chosen);
    const Index row = pair < n ? pair : (pair - n) % n;
    const Index entering = pair < n ? pair : (pair - n) / n;
    exchange(team, t, row, entering, div_(0.0 - t.value(row), t.T(row, t.column_of(entering))));
  }
}

}  // namespace stiction::inline STICTION_ISA
