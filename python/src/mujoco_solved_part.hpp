#pragma once

#include <vector>

#include "python/src/mujoco_system.hpp"

namespace stiction::python {

/// The simulations of a system that have degrees of freedom in it, as a batch over the same arrays. A solver gets them
/// alone. Others take no place in those arrays, so that a solver's input lies side by side.
class SolvedPart {
 public:
  /// The batch, which lasts until this is called again. Limits are as in JacobianBatchView, of all simulations, or
  /// null.
  JacobianBatchView<double> take(const MujocoSystem& system, const double* tolerance, const Index* max_iterations);
  /// Returns the destination of the batch's records.
  [[nodiscard]] EnvStatus* status() noexcept { return status_.data(); }
  /// Puts them where the system has them; those of others are `otherwise`.
  void hand_out(MujocoSystem& system, const EnvStatus& otherwise) const;

 private:
  std::vector<std::size_t> envs_;
  std::vector<Offset> rows_, cones_, dofs_, masses_;  ///< offsets
  std::vector<double> tolerance_;
  std::vector<Index> max_iterations_;
  std::vector<EnvStatus> status_;
};

}  // namespace stiction::python
