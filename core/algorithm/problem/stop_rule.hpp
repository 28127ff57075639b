#pragma once

#include "core/base/macros.hpp"
#include "core/job/fallback_chain.hpp"
#include "core/job/solve_job.hpp"

namespace stiction::inline STICTION_ISA {

/// When to stop.
template <class Tolerance, class Iterations>
struct Limits {
  Tolerance tolerance;                ///< on the relative residual [-]
  Iterations max_iterations;          ///< at most
  Iterations stall_window;            ///< iterations without a better residual before giving up; 0: never
  Tolerance absolute = Tolerance(0);  ///< on the absolute residual, where that is larger [w]
};
/// One environment.
using StopRule = Limits<double, Index>;

/// The environment's own limits where the batch has them, else the solve's; a stage of the fallback chain has its own
/// besides.
template <class Real>
STICTION_HD StopRule stop_rule(const SolveJob<Real>& job, Offset env) {
  StopRule rule{job.tolerance, job.max_iterations, job.stall_window, job.absolute_tolerance};
  const double* const tolerance = job.batch.env_tolerance;
  const Index* const iterations = job.batch.env_max_iterations;
  if (tolerance != nullptr && tolerance[env] >= 0.0) rule.tolerance = tolerance[env];
  if (iterations != nullptr && iterations[env] >= 0) rule.max_iterations = iterations[env];
  if (job.is_fallback_stage())
    rule.max_iterations = stage_iterations(job.stage, job.batch.env_rows(env), rule.max_iterations);
  return rule;
}

}  // namespace stiction::inline STICTION_ISA
