#pragma once

#include "bench/support/baselines.hpp"

/// Projected Gauss-Seidel as one writes it down first. It goes contact by contact and gathers a row's motion when it
/// is needed. It solves the normal, then the two tangents on the disk that the fresh normal spans. Original
/// coordinates, no packs, no tricks; the unit of bench_ratio. Everything is in raw arrays. No function of the standard
/// library is thus compiled for another instruction set and merged with the rest of the program.
namespace stiction::bench::STICTION_VARIANT {

template <class Real>
inline Real root(Real x) {
  if constexpr (sizeof(Real) == 4) {
    return __builtin_sqrtf(x);
  } else {
    return __builtin_sqrt(x);
  }
}

/// Reciprocal steps of one contact: 1 / A_nn, and 1 / largest eigenvalue of the tangential block on both tangents.
template <class Real>
inline void contact_steps(Real normal, Real t11, Real t12, Real t22, Real* inverse) {
  const Real half = (t11 - t22) / 2;
  const Real largest = (t11 + t22) / 2 + root(half * half + t12 * t12);
  inverse[0] = 1 / normal;
  inverse[1] = inverse[2] = 1 / largest;
}

/// One sweep; motion(i) is row i of A x + b.
template <class Real, class Motion>
inline void sweep(Index n, const Real* inverse, const Real* mu, Real* x, Motion&& motion) {
  for (Index i = 0; i < n; i += 3) {
    const Real normal = x[i] - inverse[i] * motion(i);
    x[i] = normal > 0 ? normal : 0;
    Real t1 = x[i + 1] - inverse[i + 1] * motion(i + 1);
    Real t2 = x[i + 2] - inverse[i + 2] * motion(i + 2);
    const Real limit = mu[i + 1] * x[i];
    const Real length = root(t1 * t1 + t2 * t2);
    if (length > limit) {
      const Real factor = limit / length;
      t1 *= factor;
      t2 *= factor;
    }
    x[i + 1] = t1;
    x[i + 2] = t2;
  }
}

/// Scatters A + diag R into a dense matrix, entry (i, j) at row_stride * i + column_stride * j.
template <class Real>
inline void make_dense(const BaselineTask<Real>& task, Real* A, Index row_stride, Index column_stride) {
  const Index n = task.n;
  for (Index k = 0; k < n * n; ++k) A[k] = 0;
  for (Index i = 0; i < n; ++i) {
    for (Offset k = task.row_offsets[i]; k < task.row_offsets[i + 1]; ++k)
      A[row_stride * i + column_stride * task.column[k]] += task.A[k];
    A[row_stride * i + column_stride * i] += task.R[i];
  }
}

/// A as a dense matrix by rows.
template <class Real>
void naive(const BaselineTask<Real>& task, int sweeps) {
  const Index n = task.n;
  Real* A = task.scratch;
  Real* inverse = A + n * n;
  make_dense(task, A, n, 1);
  for (Index i = 0; i < n; i += 3)
    contact_steps(A[i * n + i], A[(i + 1) * n + i + 1], A[(i + 1) * n + i + 2], A[(i + 2) * n + i + 2], inverse + i);
  Real* x = task.lambda;
  for (Index i = 0; i < n; ++i) x[i] = 0;
  for (int s = 0; s < sweeps; ++s)
    sweep(n, inverse, task.mu, x, [&](Index i) {
      const Real* row = A + i * n;
      Real sum = task.b[i];
      for (Index j = 0; j < n; ++j) sum += row[j] * x[j];
      return sum;
    });
}

/// The loop on the stored entries: the plain code for a sparse A.
template <class Real>
void naive_csr(const BaselineTask<Real>& task, int sweeps) {
  const Index n = task.n;
  Real* inverse = task.scratch;
  const auto entry = [&](Index i, Index j) {
    Real sum = i == j ? task.R[i] : 0;
    for (Offset k = task.row_offsets[i]; k < task.row_offsets[i + 1]; ++k)
      if (task.column[k] == j) sum += task.A[k];
    return sum;
  };
  for (Index i = 0; i < n; i += 3)
    contact_steps(entry(i, i), entry(i + 1, i + 1), entry(i + 1, i + 2), entry(i + 2, i + 2), inverse + i);
  Real* x = task.lambda;
  for (Index i = 0; i < n; ++i) x[i] = 0;
  for (int s = 0; s < sweeps; ++s)
    sweep(n, inverse, task.mu, x, [&](Index i) {
      Real sum = task.b[i] + task.R[i] * x[i];
      for (Offset k = task.row_offsets[i]; k < task.row_offsets[i + 1]; ++k) sum += task.A[k] * x[task.column[k]];
      return sum;
    });
}

}  // namespace stiction::bench::STICTION_VARIANT
