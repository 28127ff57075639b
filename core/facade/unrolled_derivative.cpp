#include <string>
#include <vector>

#include "core/base/fp_env.hpp"
#include "core/facade/contact_derivative_arrays.hpp"
#include "core/plan/plan.hpp"

// Derivative of sweeps as they run.
namespace stiction {

template <class Real>
void Derivative::unrolled_vjp(const ContactBatchView<Real>& batch, const SweepsView<Real>& sweeps,
                              const SolutionCotangentView<Real>& cotangents, const BatchCotangentView<Real>& gradients,
                              GradientStatus* status, Offset count, StreamRef stream) const {
  const ScopedFpEnv fp_env;
  check_contacts(batch, status, count, device_);
  if (sweeps.count < 0) refuse("sweeps.count = " + std::to_string(sweeps.count) + ": must be >= 0");
  if (!(sweeps.omega > 0.0 && sweeps.omega < 2.0))
    refuse("sweeps.omega = " + std::to_string(sweeps.omega) + ": must be between 0 and 2; 1 is usual");
  std::vector<NamedArray> inputs = arrays_of(batch);
  inputs.push_back(NamedArray::of("sweeps.warm_start", sweeps.warm_start, batch.row_count));
  inputs.push_back(NamedArray::of("cotangents.lambda", cotangents.lambda, count * batch.row_count));
  inputs.push_back(NamedArray::of("cotangents.w", cotangents.w, count * batch.row_count));
  auto outputs = arrays_of("gradients.", gradients, batch, count);
  outputs.push_back(NamedArray::of("sweeps.lambda", sweeps.lambda, batch.row_count));
  outputs.push_back(NamedArray::of("sweeps.by_warm_start", sweeps.by_warm_start, count * batch.row_count));
  outputs.push_back(NamedArray::of("status", status, batch.env_count));
  refuse_overlaps(outputs, inputs);
  UnrolledJob<Real> job{};
  job.batch = batch;
  fill(job, batch.law, ReactionView<Real>{}, status, count, options_);
  job.cotangents = cotangents;
  job.gradients = gradients;
  job.sweeps = sweeps;
  // A batch of a device has no structure that could be planned here: its machine plans it.
  PlanData plan;
  if (batch.space == MemorySpace::host) plan = make_plan(batch);
  job.cone_order = plan.cone_order.data();
  machine_->unrolled_vjp(job, stream);
}

template void Derivative::unrolled_vjp(const ContactBatchView<float>&, const SweepsView<float>&,
                                       const SolutionCotangentView<float>&, const BatchCotangentView<float>&,
                                       GradientStatus*, Offset, StreamRef) const;
template void Derivative::unrolled_vjp(const ContactBatchView<double>&, const SweepsView<double>&,
                                       const SolutionCotangentView<double>&, const BatchCotangentView<double>&,
                                       GradientStatus*, Offset, StreamRef) const;

}  // namespace stiction
