#pragma once

#include "core/job/body_plan_view.hpp"
#include "stiction/bodies.hpp"

namespace stiction {

/// One body solve as plain data: what crosses into code compiled for an instruction set or a device.
template <class Real>
struct BodyJob {
  BodyBatchView<Real> batch;
  BodyPlanView plan;
  BodySolutionView<Real> solution;
  const Real* warm_start;
  TimeStepping stepping;
  BodySolverOptions options;
};

}  // namespace stiction
