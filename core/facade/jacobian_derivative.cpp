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

/// The arrays of a view of cotangents or changes of a batch of J and M.
template <class View, class Real>
auto arrays_by_number(const char* const (&names)[8], const View& view, const JacobianBatchView<Real>& batch,
                      Offset count) {
  const Offset rows = count * batch.row_count;
  return std::vector{NamedArray::of(names[0], view.J, count * batch.entry_count),
                     NamedArray::of(names[1], view.M, count * batch.mass_count),
                     NamedArray::of(names[2], view.v_free, count * batch.dof_count),
                     NamedArray::of(names[3], view.target, rows),
                     NamedArray::of(names[4], view.R, rows),
                     NamedArray::of(names[5], view.mu, rows),
                     NamedArray::of(names[6], view.lo, rows),
                     NamedArray::of(names[7], view.hi, rows)};
}

/// The arrays of a view of cotangents or changes of its solution.
template <class View, class Real>
auto arrays_of_solution(const char* const (&names)[3], const View& view, const JacobianBatchView<Real>& batch,
                        Offset count) {
  return std::vector{NamedArray::of(names[0], view.lambda, count * batch.row_count),
                     NamedArray::of(names[1], view.w, count * batch.row_count),
                     NamedArray::of(names[2], view.velocity, count * batch.dof_count)};
}

/// \throws Error(invalid_argument) if an output shares memory with another array.
template <class Real>
void refuse_shared(const JacobianBatchView<Real>& batch, const ReactionView<Real>& at, const GradientStatus* status,
                   const std::vector<NamedArray>& given, std::vector<NamedArray> outputs) {
  const auto arrays = arrays_of(batch);
  std::vector<NamedArray> inputs(arrays.begin(), arrays.end());
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
  refuse_shared(
      batch, at, status,
      arrays_of_solution({"cotangents.lambda", "cotangents.w", "cotangents.velocity"}, cotangents, batch, count),
      arrays_by_number({"gradients.J", "gradients.M", "gradients.v_free", "gradients.target", "gradients.R",
                        "gradients.mu", "gradients.lo", "gradients.hi"},
                       gradients, batch, count));
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
  refuse_shared(batch, at, status,
                arrays_by_number({"tangents.J", "tangents.M", "tangents.v_free", "tangents.target", "tangents.R",
                                  "tangents.mu", "tangents.lo", "tangents.hi"},
                                 tangents, batch, count),
                arrays_of_solution({"changes.lambda", "changes.w", "changes.velocity"}, changes, batch, count));
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
