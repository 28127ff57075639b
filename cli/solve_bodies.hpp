#pragma once

#include <vector>

#include "cli/report.hpp"
#include "stiction/bodies.hpp"
#include "stiction/jacobian.hpp"

namespace stiction::cli {

/// Solves the bodies that J and M are of on that device, `repeat` times from the same reactions, which may be empty.
/// Adds to `seconds` the time to find and plan them and the shortest solve; `tracer` may be null. \throws
/// Error(unsupported) where J and M are of no such bodies.
template <class Real>
Solution<Real> solve_as_bodies(const JacobianBatch<Real>& batch, Device device, const BodySolverOptions& options,
                               const std::vector<Real>& warm_start, int repeat, Seconds& seconds, Tracer* tracer);

}  // namespace stiction::cli
