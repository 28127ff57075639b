#pragma once

#include <string>

#include "core/job/derivative_job.hpp"
#include "core/runtime/check/expect.hpp"

/// Common parts of Derivative's calls, whatever batch they differentiate.
namespace stiction {

inline void check_call(MemorySpace space, Device device, const GradientStatus* status, Offset env_count, Offset count) {
  if ((space == MemorySpace::host) != (device.kind == DeviceKind::cpu))
    refuse(
        "batch.space is not the derivative's: give batches in host memory to one of the CPU, others to one of their "
        "device");
  if (count < 0) refuse("count = " + std::to_string(count) + ": give the number of sets, >= 0");
  if (env_count > 0 && status == nullptr) refuse("status is null; point it to the array");
}

/// All of a job but the batch.
template <class Real>
void fill(DerivativeJob<Real>& job, Law law, const ReactionView<Real>& at, GradientStatus* status, Offset count,
          const DerivativeOptions& options) {
  job.at = at;
  job.law = options.law.value_or(law);
  job.residual_limit = options.residual_limit;
  job.tie_tolerance = options.tie_tolerance;
  job.max_unknowns = options.max_unknowns;
  job.count = count;
  job.status = status;
}

}  // namespace stiction
