#pragma once

#include <Eigen/Core>

#include "bench/support/naive_pgs.hpp"

/// Projected Gauss-Seidel as one writes it with Eigen. It has a dense matrix, and keeps the motion w up to date by
/// adding three columns times the contact's change.
namespace stiction::bench::STICTION_VARIANT {

template <class Real>
void eigen(const BaselineTask<Real>& task, int sweeps) {
  using Matrix = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>;
  using Vector = Eigen::Matrix<Real, Eigen::Dynamic, 1>;
  using Vector3 = Eigen::Matrix<Real, 3, 1>;
  const Index n = task.n;
  make_dense(task, task.scratch, 1, n);
  const Eigen::Map<const Matrix> A(task.scratch, n, n);
  Eigen::Map<Vector> inverse(task.scratch + n * n, n);
  Eigen::Map<Vector> w(task.scratch + n * n + n, n);
  Eigen::Map<Vector> x(task.lambda, n);
  for (Index i = 0; i < n; i += 3)
    contact_steps(A(i, i), A(i + 1, i + 1), A(i + 1, i + 2), A(i + 2, i + 2), inverse.data() + i);
  w = Eigen::Map<const Vector>(task.b, n);
  x.setZero();
  for (int s = 0; s < sweeps; ++s) {
    for (Index i = 0; i < n; i += 3) {
      Vector3 d;
      const Real normal = x[i] - inverse[i] * w[i];
      const Real fresh = normal > 0 ? normal : Real(0);
      d[0] = fresh - x[i];
      Eigen::Matrix<Real, 2, 1> t =
          x.template segment<2>(i + 1) -
          inverse[i + 1] * (w.template segment<2>(i + 1) + A.col(i).template segment<2>(i + 1) * d[0]);
      const Real limit = task.mu[i + 1] * fresh;
      const Real length = t.norm();
      if (length > limit) t *= limit / length;
      d.template tail<2>() = t - x.template segment<2>(i + 1);
      x.template segment<3>(i) += d;
      w.noalias() += A.template middleCols<3>(i) * d;
    }
  }
}

}  // namespace stiction::bench::STICTION_VARIANT
