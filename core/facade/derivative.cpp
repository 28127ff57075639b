#include "stiction/derivative.hpp"

#include <cmath>
#include <exception>
#include <string>
#include <vector>

#include "core/base/fp_env.hpp"
#include "core/facade/overlap.hpp"
#include "core/machine/derivative_machine.hpp"
#include "core/machine/jacobian_machine.hpp"
#include "core/runtime/defects.hpp"
#include "core/runtime/expect.hpp"

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
  if (options.threads < 0)
    refuse("threads = " + std::to_string(options.threads) + ": must be >= 0 (0 takes all cores)");
}

std::unique_ptr<DerivativeMachine> make_machine(Device device, const DerivativeOptions& options,
                                                const Capacity& capacity) {
  if (device.kind == DeviceKind::cpu) return make_cpu_derivative_machine(options.threads);
  if (capacity.env_rows < 1 || capacity.env_dofs < 0 || capacity.envs < 0)
    refuse("capacity.env_rows = " + std::to_string(capacity.env_rows) +
           ": a device needs the rows of the largest environment, >= 1, and counts >= 0");
  if (device.kind == DeviceKind::emulated) return make_emulated_derivative_machine(capacity, options.max_unknowns);
  return make_cuda_derivative_machine(device.ordinal, capacity, options.max_unknowns);
}

/// Everything that an index is taken from, and every array of numbers that is read.
template <class Real>
void check_batch(const ContactBatchView<Real>& batch, const ReactionView<Real>& at, const GradientStatus* status,
                 Offset count, Device device) {
  if ((batch.space == MemorySpace::host) != (device.kind == DeviceKind::cpu))
    refuse(
        "batch.space is not the derivative's: give batches in host memory to one of the CPU, others to one of their "
        "device");
  if (batch.space == MemorySpace::host) {
    const std::vector<Defect> defects = validate_structure(batch, 1);
    if (!defects.empty()) refuse(defects.front().message);
  }
  if (count < 0) refuse("count = " + std::to_string(count) + ": give the number of sets, >= 0");
  const auto need = [](const char* name, const void* array, bool needed) {
    if (needed && array == nullptr) refuse(std::string(name) + " is null; point it to the array");
  };
  const bool rows = batch.row_count > 0;
  need("batch.A", batch.A, batch.nonzero_count > 0);
  need("batch.factor", batch.factor, batch.factor_offsets != nullptr && batch.factor_count > 0);
  need("batch.b", batch.b, rows);
  need("batch.R", batch.R, rows);
  need("batch.mu", batch.mu, rows);
  need("batch.lo", batch.lo, rows);
  need("batch.hi", batch.hi, rows);
  need("at.lambda", at.lambda, rows);
  need("status", status, batch.env_count > 0);
}

/// The arrays of a view of cotangents or changes of a batch.
template <class View>
auto arrays_by_number(const char* const (&names)[7], const View& view, Offset nonzeros, Offset factors, Offset rows,
                      Offset count) {
  return std::vector{
      NamedArray::of(names[0], view.A, count * nonzeros), NamedArray::of(names[1], view.factor, count * factors),
      NamedArray::of(names[2], view.b, count * rows),     NamedArray::of(names[3], view.R, count * rows),
      NamedArray::of(names[4], view.mu, count * rows),    NamedArray::of(names[5], view.lo, count * rows),
      NamedArray::of(names[6], view.hi, count * rows)};
}

template <class Real>
std::vector<NamedArray> inputs_of(const ContactBatchView<Real>& batch, const ReactionView<Real>& at) {
  const auto arrays = arrays_of(batch);
  std::vector<NamedArray> inputs(arrays.begin(), arrays.end());
  inputs.push_back(NamedArray::of("at.lambda", at.lambda, batch.row_count));
  inputs.push_back(NamedArray::of("at.status", at.status, batch.env_count));
  return inputs;
}

template <class Real>
void fill(DerivativeJob<Real>& job, const ContactBatchView<Real>& batch, const ReactionView<Real>& at,
          GradientStatus* status, Offset count, const DerivativeOptions& options) {
  job.batch = batch;
  job.at = at;
  job.law = options.law.value_or(batch.law);
  job.residual_limit = options.residual_limit;
  job.tie_tolerance = options.tie_tolerance;
  job.max_unknowns = options.max_unknowns;
  job.count = count;
  job.status = status;
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
  auto outputs = arrays_by_number(
      {"gradients.A", "gradients.factor", "gradients.b", "gradients.R", "gradients.mu", "gradients.lo", "gradients.hi"},
      gradients, batch.nonzero_count, batch.factor_count, batch.row_count, count);
  outputs.push_back(NamedArray::of("status", status, batch.env_count));
  refuse_overlaps(outputs, inputs);
  VjpJob<Real> job;
  fill(job, batch, at, status, count, options_);
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
  const auto given = arrays_by_number(
      {"tangents.A", "tangents.factor", "tangents.b", "tangents.R", "tangents.mu", "tangents.lo", "tangents.hi"},
      tangents, batch.nonzero_count, batch.factor_count, batch.row_count, count);
  inputs.insert(inputs.end(), given.begin(), given.end());
  const std::vector outputs{NamedArray::of("changes.lambda", changes.lambda, count * batch.row_count),
                            NamedArray::of("changes.w", changes.w, count * batch.row_count),
                            NamedArray::of("status", status, batch.env_count)};
  refuse_overlaps(outputs, inputs);
  JvpJob<Real> job;
  fill(job, batch, at, status, count, options_);
  job.tangents = tangents;
  job.changes = changes;
  machine_->jvp(job, stream);
}

namespace {

template <class Real>
void check_jacobian_call(const JacobianBatchView<Real>& batch, const ReactionView<Real>& at,
                         const GradientStatus* status, Offset count) {
  if (batch.space != MemorySpace::host) refuse("batch.space is not host: copy the batch to the host");
  check_structure(batch);
  if (count < 0) refuse("count = " + std::to_string(count) + ": give the number of sets, >= 0");
  if (batch.row_count > 0 && at.lambda == nullptr) refuse("at.lambda is null; point it to the array");
  if (batch.env_count > 0 && status == nullptr) refuse("status is null; point it to the array");
}

template <class Real>
void refuse_overlaps(const JacobianVjpJob<Real>& job) {
  const JacobianBatchView<Real>& batch = job.batch;
  const Offset rows = job.count * batch.row_count, dofs = job.count * batch.dof_count;
  const auto arrays = arrays_of(batch);
  std::vector<NamedArray> inputs(arrays.begin(), arrays.end());
  inputs.push_back(NamedArray::of("at.lambda", job.at.lambda, batch.row_count));
  inputs.push_back(NamedArray::of("at.status", job.at.status, batch.env_count));
  inputs.push_back(NamedArray::of("cotangents.lambda", job.cotangents.lambda, rows));
  inputs.push_back(NamedArray::of("cotangents.w", job.cotangents.w, rows));
  inputs.push_back(NamedArray::of("cotangents.velocity", job.cotangents.velocity, dofs));
  const JacobianBatchCotangentView<Real>& to = job.gradients;
  const std::vector outputs{NamedArray::of("gradients.J", to.J, job.count * batch.entry_count),
                            NamedArray::of("gradients.M", to.M, job.count * batch.mass_count),
                            NamedArray::of("gradients.v_free", to.v_free, dofs),
                            NamedArray::of("gradients.target", to.target, rows),
                            NamedArray::of("gradients.R", to.R, rows),
                            NamedArray::of("gradients.mu", to.mu, rows),
                            NamedArray::of("gradients.lo", to.lo, rows),
                            NamedArray::of("gradients.hi", to.hi, rows),
                            NamedArray::of("status", job.status, batch.env_count)};
  stiction::refuse_overlaps(outputs, inputs);
}

}  // namespace

template <class Real>
void Derivative::vjp(const JacobianBatchView<Real>& batch, const ReactionView<Real>& at,
                     const JacobianSolutionCotangentView<Real>& cotangents,
                     const JacobianBatchCotangentView<Real>& gradients, GradientStatus* status, Offset count) const {
  const ScopedFpEnv fp_env;
  if (device_.kind != DeviceKind::cpu)
    throw Error(ErrorCode::unsupported,
                "derivatives by J and M are computed on the CPU: make a Derivative of Device::cpu() for them");
  check_jacobian_call(batch, at, status, count);
  JacobianVjpJob<Real> chain{batch, at, count, status, cotangents, gradients, nullptr, nullptr};
  refuse_overlaps(chain);
  const auto size = static_cast<std::size_t>(count * batch.row_count);
  std::vector<Real> seed(size), nu(size);
  chain.seed = seed.data();
  chain.nu = nu.data();
  const auto assembled = make_cpu_jacobian_machine<Real>(FactorUse::by_size, options_.threads);
  VjpJob<Real> job;
  fill(job, assembled->assemble(batch, nullptr, StreamRef::default_stream()), at, status, count, options_);
  job.cotangents = {seed.data(), cotangents.w};
  job.gradients.b = nu.data();
  job.gradients.R = gradients.R;
  job.gradients.mu = gradients.mu;
  job.gradients.lo = gradients.lo;
  job.gradients.hi = gradients.hi;
  seed_on_cpu(chain, options_.threads);
  machine_->vjp(job, StreamRef::default_stream());
  chain_on_cpu(chain, options_.threads);
}

template void Derivative::vjp(const JacobianBatchView<float>&, const ReactionView<float>&,
                              const JacobianSolutionCotangentView<float>&, const JacobianBatchCotangentView<float>&,
                              GradientStatus*, Offset) const;
template void Derivative::vjp(const JacobianBatchView<double>&, const ReactionView<double>&,
                              const JacobianSolutionCotangentView<double>&, const JacobianBatchCotangentView<double>&,
                              GradientStatus*, Offset) const;
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
