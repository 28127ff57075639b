#pragma once

#include "core/algorithm/problem/bounds.hpp"
#include "core/base/dense_rows.hpp"
#include "core/base/real.hpp"
#include "core/base/strided.hpp"
#include "core/job/cone_counts.hpp"
#include "core/job/plan_view.hpp"
#include "stiction/batch.hpp"
#include "stiction/status.hpp"

namespace stiction::inline STICTION_ISA {

/// One environment sliced from a batch, a plan and a solution. Row and cone numbers count from its own zero.
template <class Real>
struct EnvView {
  Index n;                       ///< rows
  Index cone_count;              ///< cones
  Offset first_row;              ///< this environment's first row in the batch
  Law law;                       ///< law of its friction cones
  const ConeKind* kind;          ///< kind                                      (cone_count)
  const Offset* cone_rows;       ///< batch-wide first row of each cone         (cone_count + 1)
  std::uint32_t flags;           ///< flags found when the batch was made
  bool is_full;                  ///< known: rows_are_full(). False means nothing
  const Offset* row_offsets;     ///< CSR rows of A, batch-wide positions       (n + 1)
  const Index* row_counts;       ///< entries of each row, or null: up to the next row's (n)
  const Offset* column_offsets;  ///< where each row's columns begin            (n)
  const Index* column;           ///< CSR columns, the whole batch's array
  const Real* A;                 ///< CSR values, the whole batch's array [w / lambda]
  const Real* factor;            ///< Y with A = Y Y', or null: A is stored     (n * dofs)
  Index dofs;                    ///< columns of Y
  const Real* b;                 ///< right-hand side [w]                       (n)
  const Real* R;                 ///< compliance [w / lambda]                   (n)
  const Real* mu;                ///< friction per axis [-]                     (n)
  const Offset* mu_offsets;      ///< where in mu each row's friction is, or null (n)
  bool normal_last;              ///< rows of friction cones: tangential first
  const Real* lo;                ///< box lower bound [lambda]                  (n)
  const Real* hi;                ///< box upper bound [lambda]                  (n)
  const Real* warm_start;        ///< first guess [lambda], or null             (n)
  Real* lambda;                  ///< out: reactions [lambda]                   (n)
  Real* w;                       ///< out: residual motion [w], or null         (n)
  EnvStatus* status;             ///< out                                       (1)
  ConeCounts counts;             ///< cones by kind
  const Index* cone_order;       ///< the plan's order of cones                 (cone_count)
  const Index* vertex_offsets;   ///< sparse path: cone position of each vertex
  const Index* color_offsets;    ///< sparse path: vertex where each colour begins
  Index color_count;             ///< sparse path: colours
  Index block_visits;            ///< visits of a block's cones before a sweep goes on

  [[nodiscard]] STICTION_HD Index cone_row(Index cone) const { return static_cast<Index>(cone_rows[cone] - first_row); }
  [[nodiscard]] STICTION_HD Index cone_size(Index cone) const {
    return static_cast<Index>(cone_rows[cone + 1] - cone_rows[cone]);
  }
  /// Row k of a cone, counted with the normal first, as the batch numbers it.
  [[nodiscard]] STICTION_HD Index row_of(Index first, Index size, Index k) const {
    if (!normal_last) return first + k;
    return k == 0 ? first + size - 1 : first + k - 1;
  }
  [[nodiscard]] STICTION_HD Real friction(Index row) const {
    return mu[mu_offsets != nullptr ? mu_offsets[row] : static_cast<Offset>(row)];
  }
  /// Stored entries of a row.
  [[nodiscard]] STICTION_HD Index entries(Index row) const {
    return row_counts != nullptr ? row_counts[row] : static_cast<Index>(row_offsets[row + 1] - row_offsets[row]);
  }
  /// Their columns.
  [[nodiscard]] STICTION_HD const Index* columns(Index row) const { return column + column_offsets[row]; }
  /// Entries from the first row's first to the last row's last, unused ones between them included.
  [[nodiscard]] STICTION_HD Offset entry_span() const { return row_offsets[n] - row_offsets[0]; }
};

/// Returns true if a row stores the columns 0, 1, 2, ... in order, as a dense matrix written as CSR does. Then no
/// column has to be looked up; the results stay the same.
template <class Real>
STICTION_HD bool is_run(const EnvView<Real>& env, Index row) {
  if (env.is_full) return true;
  return is_run(env.columns(row), env.entries(row));
}

/// rows_are_full(): then no pass over A need read columns again. For machines whose lanes each have one environment.
template <class Real>
STICTION_HD bool has_full_rows(const EnvView<Real>& env) {
  return rows_are_full(env.n, env.row_offsets, env.row_counts, env.column_offsets, env.column);
}

/// mu of a friction cone's tangential row, 1 for every other row: row i of the system is this times row i of the batch.
/// `k` is the row's number in its cone, with the normal first.
template <class Real>
STICTION_HD Real row_scale(const EnvView<Real>& env, ConeKind kind, Index k, Index row) {
  return carries_friction(kind) && k > 0 ? env.friction(row) : Real(1);
}

/// Bounds of a box row.
template <class Real>
STICTION_HD Real lower_bound(const EnvView<Real>& env, Index row) {
  return lower_or_none(env.lo[row]);
}
template <class Real>
STICTION_HD Real upper_bound(const EnvView<Real>& env, Index row) {
  return upper_or_none(env.hi[row]);
}

/// Slices the problem alone. Arrays of a plan or a solution are not set.
template <class Real>
STICTION_HD EnvView<Real> slice_problem(const ContactBatchView<Real>& batch, Law law, Offset env) {
  const Offset row = batch.env_row_offsets[env];
  const Offset cone = batch.env_cone_offsets[env];
  EnvView<Real> v;
  v.n = batch.env_rows(env);
  v.cone_count = batch.env_cones(env);
  v.first_row = row;
  v.law = law;
  v.flags = batch.env_flags == nullptr ? 0 : batch.env_flags[env];
  v.is_full = false;
  v.kind = batch.cone_kind + cone;
  v.cone_rows = batch.cone_row_offsets + cone;
  v.row_offsets = batch.row_offsets + row;
  v.row_counts = batch.row_counts == nullptr ? nullptr : batch.row_counts + row;
  v.column_offsets = (batch.column_offsets == nullptr ? batch.row_offsets : batch.column_offsets) + row;
  v.column = batch.column;
  v.A = batch.A;
  v.dofs = batch.env_dofs(env);
  v.factor = v.dofs == 0 ? nullptr : batch.factor + batch.factor_offsets[env];
  v.b = batch.b + row;
  v.R = batch.R + row;
  v.mu = batch.mu_offsets == nullptr ? batch.mu + row : batch.mu;
  v.mu_offsets = batch.mu_offsets == nullptr ? nullptr : batch.mu_offsets + row;
  v.normal_last = batch.normal_last;
  v.block_visits = batch.block_visits;
  v.lo = batch.lo + row;
  v.hi = batch.hi + row;
  return v;
}

template <class Real>
STICTION_HD EnvView<Real> slice(const ContactBatchView<Real>& batch, const PlanView& plan, Law law,
                                const Real* warm_start, Real* lambda, Real* w, EnvStatus* status, Offset env) {
  const Offset row = batch.env_row_offsets[env];
  EnvView<Real> v = slice_problem(batch, law, env);
  v.warm_start = warm_start == nullptr ? nullptr : warm_start + row;
  v.lambda = lambda + row;
  v.w = w == nullptr ? nullptr : w + row;
  v.status = status + env;
  v.counts = plan.counts[env];
  v.cone_order = plan.cone_order + batch.env_cone_offsets[env];
  v.vertex_offsets = plan.vertex_offsets + plan.env_vertex_offsets[env];
  v.color_offsets = plan.color_offsets + plan.env_color_offsets[env];
  v.color_count = plan.color_count[env];
  return v;
}

}  // namespace stiction::inline STICTION_ISA
