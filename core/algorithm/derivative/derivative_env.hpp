#pragma once

#include "core/algorithm/problem/env_view.hpp"
#include "core/job/derivative_job.hpp"
#include "core/team/scan.hpp"

/// One environment of which derivatives are taken, and the scratch that they take.
namespace stiction::inline STICTION_ISA {

/// Scratch of one environment. Unknown k of a cone has number first[cone] + k, and column k of E and F in its rows.
struct DerivativeScratch {
  double* w;                ///< residual motion [w]                               (n)
  double* E;                ///< how reactions follow the unknowns                 (n x kMaxConeRows)
  double* F;                ///< which motions stay zero                           (n x kMaxConeRows)
  double* D;                ///< of unknown k of a cone, at the cone's first row + k  (n)
  double* seed;             ///< what is pulled back or pushed forward             (n)
  double* nu;               ///< adjoint reaction, or change of the reaction       (n)
  double* image;            ///< product with A                                    (n)
  double* still;            ///< change of the motion while reactions rest         (n)
  double* K;                ///< the system's matrix, column by column             (most x most)
  double* pivots;           ///<                                                   (most)
  double* row_scale;        ///< powers of two                                     (most)
  double* column_scale;     ///<                                                   (most)
  double* unknown;          ///<                                                   (most)
  double* velocity;         ///< Y' times a vector                                 (dofs)
  double* velocity_change;  ///< dY' times the reactions                        (dofs)
  double* left;             ///< Y' F, unknown by unknown                          (most x dofs)
  double* right;            ///< Y' E                                              (most x dofs)
  Index* first;             ///< first unknown of each cone                        (cone_count + 1)
  Index* mode;              ///< ConeMode                                          (cone_count)
  Index* degenerate;        ///< 1 of a cone between two modes                     (cone_count)
  Index* cone_of_row;       ///<                                                   (n)
  Index* moving;            ///< rows of cones that have unknowns, in order; behind all, how many  (n + 1)
  Index* parts;             ///< of a scan                                         (kScanParts)
};

/// The most unknowns that an environment's scratch is for.
template <class Real>
STICTION_HD Index most_unknowns(const DerivativeJob<Real>& job, Offset env) {
  const Index n = job.batch.env_rows(env);
  return n < job.max_unknowns ? n : job.max_unknowns;
}

/// Scratch of an environment of that size, in doubles.
STICTION_HD constexpr Offset derivative_elements(Offset rows, Offset cones, Offset dofs, Offset most) {
  const Offset integers = (cones + 1) + 2 * cones + 2 * rows + 1 + kScanParts;
  return rows * (6 + 2 * kMaxConeRows) + most * (most + 4) + dofs * (2 * most + 2) + (integers + 1) / 2;
}
template <class Real>
STICTION_HD Offset derivative_elements(const DerivativeJob<Real>& job, Offset env) {
  return derivative_elements(job.batch.env_rows(env), job.batch.env_cones(env), job.batch.env_dofs(env),
                             most_unknowns(job, env));
}

/// That scratch, laid out.
STICTION_HD DerivativeScratch lay_out(Offset n, Offset cones, Offset dofs, Offset most, double* memory) {
  const auto take = [&](Offset count) {
    double* const begin = memory;
    memory += count;
    return begin;
  };
  DerivativeScratch s;
  s.K = take(most * most);
  s.E = take(n * kMaxConeRows);
  s.F = take(n * kMaxConeRows);
  s.w = take(n);
  s.D = take(n);
  s.seed = take(n);
  s.nu = take(n);
  s.image = take(n);
  s.still = take(n);
  s.pivots = take(most);
  s.row_scale = take(most);
  s.column_scale = take(most);
  s.unknown = take(most);
  s.velocity = take(dofs);
  s.velocity_change = take(dofs);
  s.left = take(most * dofs);
  s.right = take(most * dofs);
  auto* integers = reinterpret_cast<Index*>(memory);
  const auto take_integers = [&](Offset count) {
    Index* const begin = integers;
    integers += count;
    return begin;
  };
  s.first = take_integers(cones + 1);
  s.mode = take_integers(cones);
  s.degenerate = take_integers(cones);
  s.cone_of_row = take_integers(n);
  s.moving = take_integers(n + 1);
  s.parts = take_integers(kScanParts);
  return s;
}
template <class Real>
STICTION_HD DerivativeScratch lay_out(const DerivativeJob<Real>& job, Offset env, double* memory) {
  return lay_out(job.batch.env_rows(env), job.batch.env_cones(env), job.batch.env_dofs(env), most_unknowns(job, env),
                 memory);
}

/// Rows of A whose sums a lane forms side by side, so that they do not wait for each other. It reaches speed alone.
inline constexpr Index kRowsTogether = 4;

/// sum[r] += row first + r of A times in, each in stored order; kRowsTogether rows that store as many entries.
template <class Real>
STICTION_HD void add_rows_together(const EnvView<Real>& env, Index first, const double* in,
                                   double (&sum)[kRowsTogether]) {
  const auto row = [&](Index r) { return env.A + env.row_offsets[first + r]; };
  const Real *const a = row(0), *const b = row(1), *const c = row(2), *const d = row(3);
  const Index *const in_a = env.columns(first), *const in_b = env.columns(first + 1);
  const Index *const in_c = env.columns(first + 2), *const in_d = env.columns(first + 3);
  double sum_a = sum[0], sum_b = sum[1], sum_c = sum[2], sum_d = sum[3];
  for (Index k = 0; k < env.entries(first); ++k) {
    sum_a = fma_(static_cast<double>(a[k]), in[in_a[k]], sum_a);
    sum_b = fma_(static_cast<double>(b[k]), in[in_b[k]], sum_b);
    sum_c = fma_(static_cast<double>(c[k]), in[in_c[k]], sum_c);
    sum_d = fma_(static_cast<double>(d[k]), in[in_d[k]], sum_d);
  }
  sum[0] = sum_a;
  sum[1] = sum_b;
  sum[2] = sum_c;
  sum[3] = sum_d;
}

/// Whether kRowsTogether rows store as many entries.
template <class Real>
STICTION_HD bool are_alike(const EnvView<Real>& env, Index first) {
  if (first + kRowsTogether > env.n) return false;
  for (Index r = 1; r < kRowsTogether; ++r)
    if (env.entries(first + r) != env.entries(first)) return false;
  return true;
}

/// store(i, base(i) + row i of (A + diag R) times in): in double, summed in stored order by one lane.
template <Team TeamT, class Real, class Base, class Store>
STICTION_HD void apply_rows(TeamT& team, const EnvView<Real>& env, const DerivativeScratch& s, const double* in,
                            const Base& base, const Store& store) {
  if (env.factor != nullptr) {
    for_each(team, env.dofs, [&](Index k) {
      double sum = 0.0;
      for (Index i = 0; i < env.n; ++i)
        sum = fma_(static_cast<double>(env.factor[static_cast<Offset>(i) * env.dofs + k]), in[i], sum);
      s.velocity[k] = sum;
    });
    for_each(team, env.n, [&](Index i) {
      const Real* const y = env.factor + static_cast<Offset>(i) * env.dofs;
      double sum = fma_(static_cast<double>(env.R[i]), in[i], base(i));
      for (Index k = 0; k < env.dofs; ++k) sum = fma_(static_cast<double>(y[k]), s.velocity[k], sum);
      store(i, sum);
    });
    return;
  }
  const auto apply_one = [&](Index i) {
    const Real* const a = env.A + env.row_offsets[i];
    const Index* const column = env.columns(i);
    double sum = fma_(static_cast<double>(env.R[i]), in[i], base(i));
    for (Index k = 0; k < env.entries(i); ++k) sum = fma_(static_cast<double>(a[k]), in[column[k]], sum);
    store(i, sum);
  };
  if constexpr (requires { requires TeamT::size() == 1; }) {
    Index i = 0;
    while (i < env.n) {
      if (!are_alike(env, i)) {
        apply_one(i);
        ++i;
        continue;
      }
      double sum[kRowsTogether];
      for (Index r = 0; r < kRowsTogether; ++r)
        sum[r] = fma_(static_cast<double>(env.R[i + r]), in[i + r], base(i + r));
      add_rows_together(env, i, in, sum);
      for (Index r = 0; r < kRowsTogether; ++r) store(i + r, sum[r]);
      i += kRowsTogether;
    }
  } else {
    for_each(team, env.n, apply_one);
  }
}

/// out[j] = base(j) + column j of (A + diag R) times in, summed over the rows in their order; `out` is not `in`. Rows
/// whose `in` is zero add nothing: that A is finite is known by then. Lanes share the columns of a matrix whose rows
/// store every column in order.
template <Team TeamT, class Real, class Base>
STICTION_HD void apply_columns(TeamT& team, const EnvView<Real>& env, const DerivativeScratch& s, const double* in,
                               double* out, const Base& base) {
  if (env.factor != nullptr) {
    apply_rows(team, env, s, in, base, [&](Index j, double value) { out[j] = value; });
    return;
  }
  for_each(team, env.n, [&](Index j) { out[j] = fma_(static_cast<double>(env.R[j]), in[j], base(j)); });
  const auto add = [&](Index i, Index k, Index j) {
    out[j] = fma_(static_cast<double>(env.A[env.row_offsets[i] + k]), in[i], out[j]);
  };
  if (env.is_full && team.size() > 1) {
    for_each(team, env.n, [&](Index j) {
      for (Index i = 0; i < env.n; ++i)
        if (in[i] != 0.0) add(i, j, j);
    });
  } else {
    single(team, [&] {
      for (Index i = 0; i < env.n; ++i) {
        if (in[i] == 0.0) continue;
        const Index* const column = env.columns(i);
        for (Index k = 0; k < env.entries(i); ++k) add(i, k, column[k]);
      }
    });
  }
}

/// Row i of E or F times the unknowns of its cone.
STICTION_HD double from_unknowns(const DerivativeScratch& s, const double* basis, Index row) {
  const Index cone = s.cone_of_row[row];
  const Index first = s.first[cone];
  double sum = 0.0;
  for (Index k = 0; k < s.first[cone + 1] - first; ++k)
    sum = fma_(basis[static_cast<Offset>(row) * kMaxConeRows + k], s.unknown[first + k], sum);
  return sum;
}

/// f(number of the unknown, row of its D, sum over its cone's rows of their basis times in(row)) for every unknown.
template <Team TeamT, class Real, class In, class F>
STICTION_HD void to_unknowns(TeamT& team, const EnvView<Real>& env, const DerivativeScratch& s, const double* basis,
                             const In& in, const F& f) {
  for_each(team, env.cone_count, [&](Index cone) {
    const Index row = env.cone_row(cone), size = env.cone_size(cone);
    for (Index k = 0; k < s.first[cone + 1] - s.first[cone]; ++k) {
      double sum = 0.0;
      for (Index i = row; i < row + size; ++i) sum = fma_(basis[static_cast<Offset>(i) * kMaxConeRows + k], in(i), sum);
      f(s.first[cone] + k, row + k, sum);
    }
  });
}

}  // namespace stiction::inline STICTION_ISA
