#pragma once

#include "core/job/derivative_job.hpp"

namespace stiction {

/// A job of a derivative that is taken of the relaxed problem (docs/math/derivative.md, (22)), beginning at the
/// reactions that the job has.
template <class Job, class Real>
struct RelaxedJob {
  Job job;
  double kappa;  ///< product of reaction and motion [lambda w]
  Real* lambda;  ///< where the relaxed problem's reactions go  (row_count)
};

}  // namespace stiction
