#pragma once

#include <cstdint>
#include <vector>

#include "stiction/jacobian_solver.hpp"

namespace stiction::python {

/// Rows of some simulations as MuJoCo left them, one simulation after another: a Jacobian batch of accelerations and
/// forces, and its answer. Room only grows.
///
/// Newton's method in velocities takes M, and degrees of freedom as MuJoCo has them, each after its parent. For
/// solvers of A they are in reversed order. MuJoCo has M = L' D L. Backwards that is the Cholesky factor (L' D^1/2
/// read from its last row and column), which need not be computed again.
struct MujocoSystem {
  explicit MujocoSystem(MassForm form);  ///< with some room everywhere, because a view of nothing still names arrays

  MassForm mass_form;

  std::vector<Offset> env_row_offsets, env_cone_offsets, env_dof_offsets, env_mass_offsets;
  std::vector<Offset> cone_row_offsets, row_offsets;
  std::vector<std::uint8_t> cone_kind;
  std::vector<std::uint64_t> cone_id;
  std::vector<double> J, M, v_free, target, R, mu, lo, hi;
  bool has_own_zeros = false;  ///< M is zero where MuJoCo's has no entry
  std::vector<double> start;   ///< accelerations to start from, where mass_form is matrix
  std::vector<double> lambda, velocity;
  std::vector<EnvStatus> status;

  [[nodiscard]] JacobianBatchView<double> view() const;
  [[nodiscard]] BatchLayout layout() const;  ///< environments and cones, as a warm-start store reads them
  void append(const MujocoSystem& other);    ///< other simulations behind these
};

}  // namespace stiction::python
