#pragma once

#include "core/algorithm/derivative/derivative_env.hpp"

/// Products with A + diag R, E and F (docs/math/derivative.md, (7) to (11)), of one environment and of environments
/// side by side. `Modes` chooses them. Its Wide is double or a pack of doubles, each lane of which has a double's
/// operations in their order.
///
///   rows(), row(i), compliance(i)  rows and their numbers; row(i) has count, column(k), value(k)
///   cones(), cone(c)          cones and their unknowns
///   cone_of(i)                those of the cone of row i
///   kMayHaveFactor, factor()  whether A = Y Y' may come as Y
///   is_full()                 known: every row stores every column in order
///   s                         scratch: E, F, D, nu, image, unknown, ...
namespace stiction::inline STICTION_ISA {

/// Unknowns [first, first + count) of a cone, whose columns of E and F are in rows [row, row + rows).
struct ConeUnknowns {
  Index row;
  Index rows;
  Index first;
  Index count;
};

/// A row of A as a batch stores it.
template <class Real>
struct StoredRow {
  const Real* A;
  const Index* columns;
  Index count;

  [[nodiscard]] STICTION_HD Index column(Index k) const { return columns[k]; }
  [[nodiscard]] STICTION_HD double value(Index k) const { return static_cast<double>(A[k]); }
};

/// One environment.
template <class Real>
struct EnvModes {
  using Wide = double;
  static constexpr bool kMayHaveFactor = true;
  const EnvView<Real>& env;
  const DerivativeScratch& s;

  [[nodiscard]] STICTION_HD Index rows() const { return env.n; }
  [[nodiscard]] STICTION_HD double compliance(Index i) const { return static_cast<double>(env.R[i]); }
  [[nodiscard]] STICTION_HD StoredRow<Real> row(Index i) const {
    return {env.A + env.row_offsets[i], env.columns(i), env.entries(i)};
  }
  [[nodiscard]] STICTION_HD const Real* factor() const { return env.factor; }
  [[nodiscard]] STICTION_HD bool is_full() const { return env.is_full; }
  [[nodiscard]] STICTION_HD Index cones() const { return env.cone_count; }
  [[nodiscard]] STICTION_HD ConeUnknowns cone(Index c) const {
    return {env.cone_row(c), env.cone_size(c), s.first[c], s.first[c + 1] - s.first[c]};
  }
  [[nodiscard]] STICTION_HD ConeUnknowns cone_of(Index i) const { return cone(s.cone_of_row[i]); }
};
template <class Real>
STICTION_HD EnvModes<Real> modes_of(const EnvView<Real>& env, const DerivativeScratch& s) {
  return {env, s};
}

/// Rows of A whose sums a lane forms side by side, so that they do not wait for each other. It reaches speed alone.
inline constexpr Index kRowsTogether = 4;

/// sum[r] += row first + r times in, each in stored order; kRowsTogether rows that store as many entries.
template <class Rows, class In, class Wide>
STICTION_HD void add_rows_together(const Rows& rows, Index first, const In* in, Wide (&sum)[kRowsTogether]) {
  const auto a = rows.row(first), b = rows.row(first + 1), c = rows.row(first + 2), d = rows.row(first + 3);
  Wide sum_a = sum[0], sum_b = sum[1], sum_c = sum[2], sum_d = sum[3];
  for (Index k = 0; k < a.count; ++k) {
    sum_a = fma_(a.value(k), static_cast<Wide>(in[a.column(k)]), sum_a);
    sum_b = fma_(b.value(k), static_cast<Wide>(in[b.column(k)]), sum_b);
    sum_c = fma_(c.value(k), static_cast<Wide>(in[c.column(k)]), sum_c);
    sum_d = fma_(d.value(k), static_cast<Wide>(in[d.column(k)]), sum_d);
  }
  sum[0] = sum_a;
  sum[1] = sum_b;
  sum[2] = sum_c;
  sum[3] = sum_d;
}

/// Returns true if kRowsTogether rows store as many entries.
template <class Rows>
STICTION_HD bool are_alike(const Rows& rows, Index first) {
  if (first + kRowsTogether > rows.rows()) return false;
  for (Index r = 1; r < kRowsTogether; ++r)
    if (rows.row(first + r).count != rows.row(first).count) return false;
  return true;
}

/// store(i, start(i) + row i times in): in double, summed in stored order by one lane.
template <Team TeamT, class Rows, class In, class Start, class Store>
STICTION_HD void sum_rows(TeamT& team, const Rows& rows, const In* in, const Start& start, const Store& store) {
  using Wide = decltype(start(Index{0}));
  const auto sum_one = [&](Index i) {
    const auto row = rows.row(i);
    Wide sum = start(i);
    for (Index k = 0; k < row.count; ++k) sum = fma_(row.value(k), static_cast<Wide>(in[row.column(k)]), sum);
    store(i, sum);
  };
  if constexpr (requires { requires TeamT::size() == 1; }) {
    Index i = 0;
    while (i < rows.rows()) {
      if (!are_alike(rows, i)) {
        sum_one(i);
        ++i;
        continue;
      }
      Wide sum[kRowsTogether];
      for (Index r = 0; r < kRowsTogether; ++r) sum[r] = start(i + r);
      add_rows_together(rows, i, in, sum);
      for (Index r = 0; r < kRowsTogether; ++r) store(i + r, sum[r]);
      i += kRowsTogether;
    }
  } else {
    for_each(team, rows.rows(), sum_one);
  }
}

/// apply_rows() by Y.
template <Team TeamT, class Modes, class Base, class Store>
STICTION_HD void apply_factor(TeamT& team, const Modes& modes, const double* in, const Base& base, const Store& store) {
  const auto& env = modes.env;
  for_each(team, env.dofs, [&](Index k) {
    double sum = 0.0;
    for (Index i = 0; i < env.n; ++i)
      sum = fma_(static_cast<double>(env.factor[static_cast<Offset>(i) * env.dofs + k]), in[i], sum);
    modes.s.velocity[k] = sum;
  });
  for_each(team, env.n, [&](Index i) {
    const auto* const y = env.factor + static_cast<Offset>(i) * env.dofs;
    double sum = fma_(modes.compliance(i), in[i], base(i));
    for (Index k = 0; k < env.dofs; ++k) sum = fma_(static_cast<double>(y[k]), modes.s.velocity[k], sum);
    store(i, sum);
  });
}

/// store(i, base(i) + row i of (A + diag R) times in).
template <Team TeamT, class Modes, class Base, class Store>
STICTION_HD void apply_rows(TeamT& team, const Modes& modes, const typename Modes::Wide* in, const Base& base,
                            const Store& store) {
  if constexpr (Modes::kMayHaveFactor)
    if (modes.factor() != nullptr) return apply_factor(team, modes, in, base, store);
  sum_rows(team, modes, in, [&](Index i) { return fma_(modes.compliance(i), in[i], base(i)); }, store);
}

/// out[j] = base(j) + column j of (A + diag R) times in, summed over the rows in their order; `out` is not `in`. Rows
/// whose `in` is zero add nothing: that A is finite is known by then. Lanes share the columns of a matrix whose rows
/// store every column in order.
template <Team TeamT, class Modes, class Base>
STICTION_HD void apply_columns(TeamT& team, const Modes& modes, const typename Modes::Wide* in,
                               typename Modes::Wide* out, const Base& base) {
  using Wide = typename Modes::Wide;
  if constexpr (Modes::kMayHaveFactor)
    if (modes.factor() != nullptr)
      return apply_factor(team, modes, in, base, [&](Index j, double value) { out[j] = value; });
  for_each(team, modes.rows(), [&](Index j) { out[j] = fma_(modes.compliance(j), in[j], base(j)); });
  if (modes.is_full() && team.size() > 1) {
    for_each(team, modes.rows(), [&](Index j) {
      for (Index i = 0; i < modes.rows(); ++i)
        if (any(in[i] != Wide(0))) out[j] = fma_(modes.row(i).value(j), in[i], out[j]);
    });
  } else {
    single(team, [&] {
      for (Index i = 0; i < modes.rows(); ++i) {
        if (!any(in[i] != Wide(0))) continue;
        const auto row = modes.row(i);
        for (Index k = 0; k < row.count; ++k) out[row.column(k)] = fma_(row.value(k), in[i], out[row.column(k)]);
      }
    });
  }
}

/// Row i of E or F times the unknowns of its cone.
template <class Modes, class Wide>
STICTION_HD Wide from_unknowns(const Modes& modes, const Wide* basis, Index i) {
  const ConeUnknowns cone = modes.cone_of(i);
  Wide sum(0);
  for (Index k = 0; k < cone.count; ++k)
    sum = fma_(basis[static_cast<Offset>(i) * kMaxConeRows + k], modes.s.unknown[cone.first + k], sum);
  return sum;
}

/// f(number of the unknown, row of its D, sum over its cone's rows of their basis times in(row)) for every unknown.
template <Team TeamT, class Modes, class Wide, class In, class F>
STICTION_HD void to_unknowns(TeamT& team, const Modes& modes, const Wide* basis, const In& in, const F& f) {
  for_each(team, modes.cones(), [&](Index c) {
    const ConeUnknowns cone = modes.cone(c);
    for (Index k = 0; k < cone.count; ++k) {
      Wide sum(0);
      for (Index i = cone.row; i < cone.row + cone.rows; ++i)
        sum = fma_(basis[static_cast<Offset>(i) * kMaxConeRows + k], in(i), sum);
      f(cone.first + k, cone.row + k, sum);
    }
  });
}

}  // namespace stiction::inline STICTION_ISA
