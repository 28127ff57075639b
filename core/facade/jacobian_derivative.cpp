#include <vector>

#include "core/base/fp_env.hpp"
#include "core/facade/derivative_calls.hpp"
#include "core/facade/jacobian_arrays.hpp"
#include "core/facade/overlap.hpp"
#include "core/machine/derivative_machine.hpp"
#include "core/machine/jacobian_machine.hpp"

// Derivative of batches of J and M.
namespace stiction {

namespace {

template <class Real>
void check_batch(const JacobianBatchView<Real>& batch, const ReactionView<Real>& at, const GradientStatus* status,
                 Offset count, Device device) {
  check_call(batch.space, device, status, batch.env_count, count);
  if (batch.space == MemorySpace::host)
    check_structure(batch);
  else
    check_arrays(batch);
  if (batch.row_count > 0 && at.lambda == nullptr) refuse("at.lambda is null; point it to the array");
}

/// The arrays of a view of cotangents or changes of its solution.
template <class Numbers, class Real>
std::vector<NamedArray> arrays_of_solution(const char* owner, const Numbers& numbers,
                                           const JacobianBatchView<Real>& batch, Offset count) {
  return {NamedArray::of("lambda", numbers.lambda, count * batch.row_count, owner),
          NamedArray::of("w", numbers.w, count * batch.row_count, owner),
          NamedArray::of("velocity", numbers.velocity, count * batch.dof_count, owner)};
}

/// \throws Error(invalid_argument) if an output shares memory with another array.
template <class Real>
void refuse_shared(const JacobianBatchView<Real>& batch, const ReactionView<Real>& at, const GradientStatus* status,
                   const std::vector<NamedArray>& given, std::vector<NamedArray> outputs) {
  std::vector<NamedArray> inputs = arrays_of(batch);
  inputs.push_back(NamedArray::of("at.lambda", at.lambda, batch.row_count));
  inputs.push_back(NamedArray::of("at.status", at.status, batch.env_count));
  inputs.insert(inputs.end(), given.begin(), given.end());
  outputs.push_back(NamedArray::of("status", status, batch.env_count));
  refuse_overlaps(outputs, inputs);
}

}  // namespace

template <class Real>
void Derivative::vjp(const JacobianBatchView<Real>& batch, const ReactionView<Real>& at,
                     const JacobianSolutionCotangentView<Real>& cotangents,
                     const JacobianBatchCotangentView<Real>& gradients, GradientStatus* status, Offset count,
                     StreamRef stream) const {
  const ScopedFpEnv fp_env;
  check_batch(batch, at, status, count, device_);
  refuse_shared(batch, at, status, arrays_of_solution("cotangents.", cotangents, batch, count),
                arrays_of("gradients.", gradients, batch, count));
  JacobianVjpJob<Real> job{};
  fill(job.contact, batch.law, at, status, count, options_);
  job.assembly.batch = batch;
  job.cotangents = cotangents;
  job.gradients = gradients;
  job.contact.cotangents.w = cotangents.w;
  job.contact.gradients.R = gradients.R;
  job.contact.gradients.mu = gradients.mu;
  job.contact.gradients.lo = gradients.lo;
  job.contact.gradients.hi = gradients.hi;
  machine_->vjp(job, stream);
}

template <class Real>
void Derivative::jvp(const JacobianBatchView<Real>& batch, const ReactionView<Real>& at,
                     const JacobianBatchTangentView<Real>& tangents, const JacobianSolutionTangentView<Real>& changes,
                     GradientStatus* status, Offset count, StreamRef stream) const {
  const ScopedFpEnv fp_env;
  check_batch(batch, at, status, count, device_);
  refuse_shared(batch, at, status, arrays_of("tangents.", tangents, batch, count),
                arrays_of_solution("changes.", changes, batch, count));
  JacobianJvpJob<Real> job{};
  fill(job.contact, batch.law, at, status, count, options_);
  job.assembly.batch = batch;
  job.tangents = tangents;
  job.changes = changes;
  job.contact.tangents.R = tangents.R;
  job.contact.tangents.mu = tangents.mu;
  job.contact.tangents.lo = tangents.lo;
  job.contact.tangents.hi = tangents.hi;
  job.contact.changes.w = changes.w;
  machine_->jvp(job, stream);
}

template void Derivative::vjp(const JacobianBatchView<float>&, const ReactionView<float>&,
                              const JacobianSolutionCotangentView<float>&, const JacobianBatchCotangentView<float>&,
                              GradientStatus*, Offset, StreamRef) const;
template void Derivative::vjp(const JacobianBatchView<double>&, const ReactionView<double>&,
                              const JacobianSolutionCotangentView<double>&, const JacobianBatchCotangentView<double>&,
                              GradientStatus*, Offset, StreamRef) const;
template void Derivative::jvp(const JacobianBatchView<float>&, const ReactionView<float>&,
                              const JacobianBatchTangentView<float>&, const JacobianSolutionTangentView<float>&,
                              GradientStatus*, Offset, StreamRef) const;
template void Derivative::jvp(const JacobianBatchView<double>&, const ReactionView<double>&,
                              const JacobianBatchTangentView<double>&, const JacobianSolutionTangentView<double>&,
                              GradientStatus*, Offset, StreamRef) const;

}  // namespace stiction
