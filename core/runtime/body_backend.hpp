#pragma once

#include "core/schedule/body_plan.hpp"

namespace stiction {

/// One body solve, as a machine receives it: everything checked.
template <class Real>
struct BodyRequest {
  const BodyPlanData& plan;
  BodyBatchView<Real> batch;
  BodySolutionView<Real> solution;
  const Real* warm_start;
  TimeStepping stepping;
  BodySolverOptions options;
};

/// The structural defects alone: what validate() lists first.
template <class Real>
std::vector<Defect> validate_structure(const BodyBatchView<Real>& batch, std::size_t limit);

void solve_bodies_on_cpu(const BodyRequest<float>& request);
void solve_bodies_on_cpu(const BodyRequest<double>& request);

}  // namespace stiction
