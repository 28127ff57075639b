#include "stiction/derivative.hpp"

#include <cmath>
#include <exception>
#include <string>
#include <vector>

#include "core/base/fp_env.hpp"
#include "core/facade/contact_derivative_arrays.hpp"
#include "stiction/error.hpp"

namespace stiction {

namespace {

void check_options(const DerivativeOptions& options) {
  if (!(options.residual_limit >= 0.0))
    refuse("residual_limit = " + std::to_string(options.residual_limit) + ": must be >= 0 (infinity lets all pass)");
  if (!(options.tie_tolerance >= 0.0) || !std::isfinite(options.tie_tolerance))
    refuse("tie_tolerance = " + std::to_string(options.tie_tolerance) + ": must be finite and >= 0; 1e-6 is usual");
  if (options.max_unknowns < 0 || options.max_unknowns > kMostUnknowns)
    refuse("max_unknowns = " + std::to_string(options.max_unknowns) + ": must be from 0 to " +
           std::to_string(kMostUnknowns));
  if (!(options.kappa >= 0.0) || !std::isfinite(options.kappa))
    refuse("kappa = " + std::to_string(options.kappa) +
           ": must be finite and >= 0; 0 differentiates the exact solution");
  if (options.threads < 0)
    refuse("threads = " + std::to_string(options.threads) + ": must be >= 0 (0 takes all cores)");
}

std::unique_ptr<DerivativeMachine> make_machine(Device device, const DerivativeOptions& options,
                                                const Capacity& capacity) {
  if (device.kind == DeviceKind::cpu) return make_cpu_derivative_machine(options.threads, options.kappa);
  if (capacity.env_rows < 1 || capacity.env_dofs < 0 || capacity.envs < 0)
    refuse("capacity.env_rows = " + std::to_string(capacity.env_rows) +
           ": a device needs the rows of the largest environment, >= 1, and counts >= 0");
  if (device.kind == DeviceKind::emulated) return make_emulated_derivative_machine(capacity, options);
  return make_cuda_derivative_machine(device.ordinal, capacity, options);
}

/// Everything that an index is taken from, and every array of numbers that is read.
template <class Real>
void check_batch(const ContactBatchView<Real>& batch, const ReactionView<Real>& at, const GradientStatus* status,
                 Offset count, Device device) {
  check_contacts(batch, status, count, device);
  if (batch.row_count > 0 && at.lambda == nullptr) refuse("at.lambda is null; point it to the array");
}

template <class Real>
std::vector<NamedArray> inputs_of(const ContactBatchView<Real>& batch, const ReactionView<Real>& at) {
  std::vector<NamedArray> inputs = arrays_of(batch);
  inputs.push_back(NamedArray::of("at.lambda", at.lambda, batch.row_count));
  inputs.push_back(NamedArray::of("at.status", at.status, batch.env_count));
  return inputs;
}

}  // namespace

Derivative::Derivative(Device device, const DerivativeOptions& options, const Capacity& capacity)
    : device_(device), options_(options) {
  const ScopedFpEnv fp_env;
  check_options(options);
  machine_ = make_machine(device, options, capacity);
}
Derivative::~Derivative() = default;
Derivative::Derivative(Derivative&&) noexcept = default;
Derivative& Derivative::operator=(Derivative&&) noexcept = default;

void Derivative::synchronize(StreamRef stream) const {
  machine_->synchronize(stream);
}

template <class Real>
void Derivative::vjp(const ContactBatchView<Real>& batch, const ReactionView<Real>& at,
                     const SolutionCotangentView<Real>& cotangents, const BatchCotangentView<Real>& gradients,
                     GradientStatus* status, Offset count, StreamRef stream) const {
  const ScopedFpEnv fp_env;
  check_batch(batch, at, status, count, device_);
  std::vector<NamedArray> inputs = inputs_of(batch, at);
  inputs.push_back(NamedArray::of("cotangents.lambda", cotangents.lambda, count * batch.row_count));
  inputs.push_back(NamedArray::of("cotangents.w", cotangents.w, count * batch.row_count));
  auto outputs = arrays_of("gradients.", gradients, batch, count);
  outputs.push_back(NamedArray::of("status", status, batch.env_count));
  refuse_overlaps(outputs, inputs);
  VjpJob<Real> job;
  job.batch = batch;
  fill(job, batch.law, at, status, count, options_);
  job.cotangents = cotangents;
  job.gradients = gradients;
  machine_->vjp(job, stream);
}

template <class Real>
void Derivative::jvp(const ContactBatchView<Real>& batch, const ReactionView<Real>& at,
                     const BatchTangentView<Real>& tangents, const SolutionTangentView<Real>& changes,
                     GradientStatus* status, Offset count, StreamRef stream) const {
  const ScopedFpEnv fp_env;
  check_batch(batch, at, status, count, device_);
  std::vector<NamedArray> inputs = inputs_of(batch, at);
  const auto given = arrays_of("tangents.", tangents, batch, count);
  inputs.insert(inputs.end(), given.begin(), given.end());
  const std::vector outputs{NamedArray::of("changes.lambda", changes.lambda, count * batch.row_count),
                            NamedArray::of("changes.w", changes.w, count * batch.row_count),
                            NamedArray::of("status", status, batch.env_count)};
  refuse_overlaps(outputs, inputs);
  JvpJob<Real> job;
  job.batch = batch;
  fill(job, batch.law, at, status, count, options_);
  job.tangents = tangents;
  job.changes = changes;
  machine_->jvp(job, stream);
}

template void Derivative::vjp(const ContactBatchView<float>&, const ReactionView<float>&,
                              const SolutionCotangentView<float>&, const BatchCotangentView<float>&, GradientStatus*,
                              Offset, StreamRef) const;
template void Derivative::vjp(const ContactBatchView<double>&, const ReactionView<double>&,
                              const SolutionCotangentView<double>&, const BatchCotangentView<double>&, GradientStatus*,
                              Offset, StreamRef) const;
template void Derivative::jvp(const ContactBatchView<float>&, const ReactionView<float>&,
                              const BatchTangentView<float>&, const SolutionTangentView<float>&, GradientStatus*,
                              Offset, StreamRef) const;
template void Derivative::jvp(const ContactBatchView<double>&, const ReactionView<double>&,
                              const BatchTangentView<double>&, const SolutionTangentView<double>&, GradientStatus*,
                              Offset, StreamRef) const;

}  // namespace stiction
