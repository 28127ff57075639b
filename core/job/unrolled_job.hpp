#pragma once

#include "core/job/derivative_job.hpp"

namespace stiction {

/// Cotangents of the results of so many sweeps, to cotangents of the batch and of where they began. `at.lambda` is not
/// read.
template <class Real>
struct UnrolledJob : VjpJob<Real> {
  SweepsView<Real> sweeps;
  const Index* cone_order;  ///< in which order each environment's cones are visited  (cone_count)
};

}  // namespace stiction
