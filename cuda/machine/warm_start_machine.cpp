#include "cuda/machine/warm_start_machine.hpp"

#include <cstring>
#include <utility>

#include "cuda/api/kernel_catalogue.hpp"
#include "stiction/error.hpp"

namespace stiction {

namespace cuda {

namespace {

/// Lanes for an environment with the cones that one has room for on average. They reach speed only.
int team_lanes(const WarmStartCapacity& capacity) {
  int lanes = 8;
  while (lanes < kMostLanes && Offset{lanes} * capacity.envs < capacity.cones) lanes *= 2;
  return lanes;
}

template <class Real>
const WarmStartKernels& kernels_of(const DeviceApi& api) {
  return api.kernels().warm_start[sizeof(Real) == sizeof(float) ? 0 : 1];
}

}  // namespace

template <class Real>
DeviceWarmStartMachine<Real>::DeviceWarmStartMachine(std::shared_ptr<DeviceApi> api, const WarmStartCapacity& capacity,
                                                     bool eager)
    : api_(std::move(api)), eager_(eager), lanes_(team_lanes(capacity)), mask_copied_(*api_) {
  view_.env_capacity = capacity.envs;
  view_.cone_capacity = capacity.cones;
  view_.row_capacity = capacity.rows;
  arrays_.add(view_.slot, capacity.envs);
  arrays_.add(view_.record, capacity.envs);
  arrays_.add(view_.stored, capacity.cones);
  arrays_.add(view_.sorting, capacity.cones);
  arrays_.add(view_.lambda, capacity.rows);
  arrays_.add(mask_, capacity.envs);
  memory_ = DeviceMemory(*api_, arrays_.bytes());
  arrays_.place(memory_.get());
  mask_host_ = PinnedMemory(*api_, static_cast<std::size_t>(capacity.envs));
  const Stream stream(*api_);
  // A slot of zeros holds nothing.
  if (memory_.bytes() > 0) api_->fill_zero(memory_.get(), memory_.bytes(), stream.get());
  api_->synchronize(stream.get());
  const WarmStartKernels& kernels = kernels_of<Real>(*api_);
  api_->prepare(kernels.load, {1, lanes_});
  api_->prepare(kernels.store, {1, lanes_});
  api_->prepare(kernels.reset, {1, 1});
}

template <class Real>
DeviceWarmStartMachine<Real>::~DeviceWarmStartMachine() {
  try {
    api_->await(mask_copied_.get());
  } catch (const Error&) {
    // A device that failed copies nothing any more.
  }
}

template <class Real>
template <class Job>
void DeviceWarmStartMachine<Real>::queue(const KernelRef& kernel, Offset teams, int lanes, const Job& job,
                                         StreamRef stream) {
  if (teams == 0) return;
  LaunchShape shape;
  shape.teams = teams;
  shape.lanes = lanes;
  api_->launch(kernel, shape, &job, stream.handle());
  if (eager_) api_->synchronize(stream.handle());
}

template <class Real>
void DeviceWarmStartMachine<Real>::load(const WarmStartLoadJob<Real>& request, StreamRef stream) {
  WarmStartLoadJob<Real> job = request;
  job.memory = view_;
  queue(kernels_of<Real>(*api_).load, job.batch.env_count, lanes_, job, stream);
}

template <class Real>
void DeviceWarmStartMachine<Real>::store(const WarmStartStoreJob<Real>& request, StreamRef stream) {
  WarmStartStoreJob<Real> job = request;
  job.memory = view_;
  queue(kernels_of<Real>(*api_).store, view_.env_capacity, lanes_, job, stream);
}

template <class Real>
void DeviceWarmStartMachine<Real>::reset(std::span<const Offset> envs, StreamRef stream) {
  if (view_.env_capacity == 0) return;
  if (api_->capturing(stream.handle()))
    throw Error(ErrorCode::invalid_argument,
                "reset of a list cannot be captured into a graph, which would replay this list: use reset_where with a "
                "mask in device memory");
  api_->await(mask_copied_.get());
  const auto bytes = static_cast<std::size_t>(view_.env_capacity);
  auto* const mask = reinterpret_cast<std::uint8_t*>(mask_host_.get());
  std::memset(mask, 0, bytes);
  for (const Offset env : envs) mask[env] = 1;
  api_->copy(mask_, mask, bytes, CopyKind::to_device, stream.handle());
  api_->record(mask_copied_.get(), stream.handle());
  reset_where(mask_, stream);
}

template <class Real>
void DeviceWarmStartMachine<Real>::reset_where(const std::uint8_t* mask, StreamRef stream) {
  queue(kernels_of<Real>(*api_).reset, view_.env_capacity, 1, WarmStartResetJob<Real>{view_, mask}, stream);
}

template <class Real>
void DeviceWarmStartMachine<Real>::records(std::span<WarmStartRecord> out, StreamRef stream) {
  if (!out.empty()) api_->copy(out.data(), view_.record, out.size_bytes(), CopyKind::to_host, stream.handle());
  api_->synchronize(stream.handle());
}

template class DeviceWarmStartMachine<float>;
template class DeviceWarmStartMachine<double>;

}  // namespace cuda

}  // namespace stiction
