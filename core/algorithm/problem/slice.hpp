#pragma once

#include "core/algorithm/problem/env_view.hpp"
#include "core/job/solve_job.hpp"

namespace stiction::inline STICTION_ISA {

/// One environment of a job.
template <class Real>
STICTION_HD EnvView<Real> slice(const SolveJob<Real>& job, Offset env) {
  return slice(job.batch, job.plan, job.law, job.warm_start, job.lambda, job.w, job.status, env);
}

}  // namespace stiction::inline STICTION_ISA
