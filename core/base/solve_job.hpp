#pragma once

#include "core/base/plan_view.hpp"
#include "stiction/batch.hpp"
#include "stiction/status.hpp"

namespace stiction {

/// One solve as plain data in the memory of the machine that does it: what every kernel is given.
template <class Real>
struct SolveJob {
  ContactBatchView<Real> batch;
  PlanView plan;
  const Real* warm_start;
  Real* lambda;
  Real* w;
  EnvStatus* status;
  double tolerance;
  Index max_iterations;
  Index stall_window;
  SolverKind rung;  ///< automatic: whoever solves iterates as long as it may; else as long as that rung of the ladder
  Real omega;
  Law law;
};

}  // namespace stiction
