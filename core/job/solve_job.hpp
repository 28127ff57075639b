#pragma once

#include "core/job/plan_view.hpp"
#include "core/job/workspace.hpp"
#include "stiction/batch.hpp"
#include "stiction/status.hpp"

namespace stiction {

/// One solve as plain data in the memory of the machine that does it: the argument of every kernel.
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
  Real omega;
  Law law;
  int stage = -1;  ///< of the fallback chain, none below 0: iterations are the stage's, and an answer that is there is
                   ///< not given up
  double absolute_tolerance = 0.0;  ///< on the absolute residual [w]; solved is where either holds
  Index direct_rows = kDirectRows;  ///< rows of the largest environment that gets a method's matrices

  [[nodiscard]] STICTION_HD bool is_fallback_stage() const { return stage >= 0; }
};

}  // namespace stiction
