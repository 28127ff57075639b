#pragma once

#include <cstddef>
#include <vector>

#include "stiction/jacobian_solver.hpp"

namespace stiction::test {

/// Arrays that a solve of a Jacobian batch writes, in the shapes of its view, filled with `unwritten` before.
template <class Real>
struct JacobianAnswer {
  std::vector<Real> lambda, w, velocity;
  std::vector<EnvStatus> status;

  explicit JacobianAnswer(const JacobianBatchView<Real>& batch, Real unwritten = 0)
      : lambda(static_cast<std::size_t>(batch.row_count), unwritten),
        w(lambda),
        velocity(static_cast<std::size_t>(batch.dof_count), unwritten),
        status(static_cast<std::size_t>(batch.env_count)) {}
  [[nodiscard]] JacobianSolutionView<Real> view() { return {lambda.data(), w.data(), velocity.data(), status.data()}; }
};

}  // namespace stiction::test
