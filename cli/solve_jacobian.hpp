#pragma once

#include <vector>

#include "cli/report.hpp"
#include "stiction/jacobian.hpp"

namespace stiction::cli {

/// Solves J and M on that device, `repeat` times from the same start, which may be empty. Adds to `seconds` the time
/// to plan and the shortest solve.
template <class Real>
Solution<Real> solve_jacobians(const JacobianBatch<Real>& batch, Device device, const SolverOptions& options,
                               const std::vector<Real>& warm_start, int repeat, Seconds& seconds);

}  // namespace stiction::cli
