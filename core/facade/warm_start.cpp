#include "stiction/warm_start.hpp"

#include <cmath>
#include <exception>
#include <string>

#include "core/base/fp_env.hpp"
#include "core/machine/warm_start_machine.hpp"
#include "core/runtime/check/expect.hpp"
#include "stiction/error.hpp"

namespace stiction {

namespace {

void check_capacity(const char* what, Offset room) {
  if (room < 0) refuse("capacity." + std::string(what) + " = " + std::to_string(room) + ": must be >= 0");
}

void check_options(const WarmStartOptions& options) {
  if (!(options.beta > 0.0 && options.beta <= 1.0))
    refuse("beta = " + std::to_string(options.beta) + ": must be in (0, 1]; 0.8 to 1 is usual");
  if (options.scaling != StepScaling::capped && options.scaling != StepScaling::none &&
      options.scaling != StepScaling::proportional)
    refuse("scaling = " + std::to_string(static_cast<int>(options.scaling)) +
           ": choose capped, none or proportional of StepScaling");
  if (options.threads < 0)
    refuse("threads = " + std::to_string(options.threads) + ": must be >= 0 (0 takes all cores)");
}

/// Contacts: cones without offsets of rows, which have three each (warm_start.hpp).
template <class Real>
BatchLayout cones_of(const BodyBatchView<Real>& batch) {
  BatchLayout cones;
  cones.env_count = batch.env_count;
  cones.cone_count = batch.contact_count;
  cones.row_count = 3 * batch.contact_count;
  cones.env_cone_offsets = batch.env_contact_offsets;
  cones.space = batch.space;
  return cones;
}

template <class Real>
std::unique_ptr<WarmStartMachine<Real>> make_machine(Device device, const WarmStartCapacity& capacity,
                                                     const WarmStartOptions& options) {
  if (device.kind == DeviceKind::cuda) return make_cuda_warm_start_machine<Real>(device.ordinal, capacity);
  if (device.kind == DeviceKind::emulated) return make_emulated_warm_start_machine<Real>(capacity);
  try {
    return make_cpu_warm_start_machine<Real>(capacity, options.threads);
  } catch (const std::exception&) {  // bad_alloc, or length_error where no vector could be that long
    throw Error(ErrorCode::out_of_memory, "no memory for a store of " + std::to_string(capacity.envs) +
                                              " environments, " + std::to_string(capacity.cones) + " cones and " +
                                              std::to_string(capacity.rows) + " rows: ask for less room");
  }
}

}  // namespace

template <class Real>
WarmStartStore<Real>::WarmStartStore(Device device, const WarmStartCapacity& capacity, const WarmStartOptions& options)
    : device_(device), capacity_(capacity), options_(options) {
  check_capacity("envs", capacity.envs);
  check_capacity("cones", capacity.cones);
  check_capacity("rows", capacity.rows);
  check_options(options);
  machine_ = make_machine<Real>(device, capacity, options);
}
template <class Real>
WarmStartStore<Real>::~WarmStartStore() = default;
template <class Real>
WarmStartStore<Real>::WarmStartStore(WarmStartStore&&) noexcept = default;
template <class Real>
WarmStartStore<Real>& WarmStartStore<Real>::operator=(WarmStartStore&&) noexcept = default;

template <class Real>
void WarmStartStore<Real>::check(const BatchLayout& batch, const std::uint64_t* cone_id, double dt) const {
  const MemorySpace own = device_.kind == DeviceKind::cpu ? MemorySpace::host : MemorySpace::cuda;
  if (batch.space != own)
    refuse("batch.space is not the store's: a store serves batches where it was made, on the CPU or on a CUDA device");
  if (batch.env_count > capacity_.envs)
    refuse("the batch has " + std::to_string(batch.env_count) + " environments, the store has room for " +
           std::to_string(capacity_.envs) + ": make it with capacity.envs of the largest batch");
  if (batch.cone_count > 0 && cone_id == nullptr)
    refuse("cone_id is null: give one 64-bit number per cone (" + std::to_string(batch.cone_count) + ")");
  if (!(dt > 0.0) || !std::isfinite(dt))
    refuse("dt = " + std::to_string(dt) + ": must be the finite, positive length of this step");
}

template <class Real>
void WarmStartStore<Real>::load(const BatchLayout& batch, const std::uint64_t* cone_id, double dt, Real* guess,
                                StreamRef stream) {
  const ScopedFpEnv fp_env;
  check(batch, cone_id, dt);
  if (batch.row_count > 0 && guess == nullptr)
    refuse("guess is null: give it room for one number per row (" + std::to_string(batch.row_count) + ")");
  machine_->load(WarmStartLoadJob<Real>{{}, batch, cone_id, guess, dt, options_.beta, options_.scaling}, stream);
}

template <class Real>
void WarmStartStore<Real>::store(const BatchLayout& batch, const std::uint64_t* cone_id,
                                 const SolutionView<Real>& solution, double dt, StreamRef stream) {
  check(batch, cone_id, dt);
  if (batch.row_count > 0 && solution.lambda == nullptr) refuse("solution.lambda is null: give the reactions to store");
  if (batch.env_count > 0 && solution.status == nullptr)
    refuse("solution.status is null: without it a failed environment could not be told from a solved one");
  machine_->store(WarmStartStoreJob<Real>{{}, batch, cone_id, solution.lambda, solution.status, dt}, stream);
}

template <class Real>
void WarmStartStore<Real>::load(const BodyBatchView<Real>& batch, const std::uint64_t* contact_id, double dt,
                                Real* guess, StreamRef stream) {
  const ScopedFpEnv fp_env;
  load(cones_of(batch), contact_id, dt, guess, stream);
}
template <class Real>
void WarmStartStore<Real>::store(const BodyBatchView<Real>& batch, const std::uint64_t* contact_id,
                                 const BodySolutionView<Real>& solution, double dt, StreamRef stream) {
  store(cones_of(batch), contact_id, {solution.impulse, solution.w, solution.status}, dt, stream);
}

template <class Real>
void WarmStartStore<Real>::reset(std::span<const Offset> envs, StreamRef stream) {
  for (const Offset env : envs)
    if (env < 0 || env >= capacity_.envs)
      refuse("environment " + std::to_string(env) + " cannot be reset: the store has environments 0 to " +
             std::to_string(capacity_.envs - 1));
  machine_->reset(envs, stream);
}

template <class Real>
void WarmStartStore<Real>::reset_where(const std::uint8_t* mask, StreamRef stream) {
  if (mask == nullptr && capacity_.envs > 0)
    refuse("mask is null: give one byte per environment of the capacity (" + std::to_string(capacity_.envs) +
           "), or call reset_all");
  machine_->reset_where(mask, stream);
}

template <class Real>
void WarmStartStore<Real>::reset_all(StreamRef stream) {
  machine_->reset_where(nullptr, stream);
}

template <class Real>
void WarmStartStore<Real>::records(std::span<WarmStartRecord> out, StreamRef stream) const {
  if (out.size() > static_cast<std::size_t>(capacity_.envs))
    refuse(std::to_string(out.size()) + " records were asked for, the store has " + std::to_string(capacity_.envs) +
           " environments");
  machine_->records(out, stream);
}

template class WarmStartStore<float>;
template class WarmStartStore<double>;

}  // namespace stiction
