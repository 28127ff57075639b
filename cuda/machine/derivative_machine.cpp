#include "cuda/machine/derivative_machine.hpp"

#include <utility>

#include "core/base/extents.hpp"
#include "cuda/kernels/derivative_program.hpp"
#include "stiction/error.hpp"

namespace stiction::cuda {

namespace {

/// Most device memory for the scratch of all teams, unless a single one needs more.
constexpr Offset kScratchBytes = Offset{1} << 29;
constexpr Offset kTeamsPerProcessor = 16;

/// Lanes for an environment of that size. They reach speed only.
int team_lanes(Index rows) {
  return rows <= 64 ? kWarp : rows <= 256 ? 4 * kWarp : kMostLanes;
}

}  // namespace

DeviceDerivativeMachine::DeviceDerivativeMachine(std::shared_ptr<DeviceApi> api, const Capacity& capacity,
                                                 Index max_unknowns, bool eager)
    : api_(std::move(api)),
      eager_(eager),
      most_rows_(capacity.env_rows),
      most_dofs_(capacity.env_dofs),
      slot_(derivative_elements(capacity.env_rows, capacity.env_rows, capacity.env_dofs,
                                smaller_of(capacity.env_rows, max_unknowns))),
      done_(*api_) {
  const Offset slot_bytes = slot_ * static_cast<Offset>(sizeof(double));
  const Offset fitting = larger_of<Offset>(1, kScratchBytes / slot_bytes);
  shape_.teams = smaller_of(fitting, kTeamsPerProcessor * api_->facts().processors);
  if (capacity.envs > 0) shape_.teams = smaller_of(shape_.teams, capacity.envs);
  shape_.lanes = team_lanes(capacity.env_rows);
  set_.add(scratch_, shape_.teams * slot_);
  memory_ = DeviceMemory(*api_, set_.bytes());
  set_.place(memory_.get());
  for (const DerivativeKernels& kernels : api_->kernels().derivative) {
    api_->prepare(kernels.vjp, shape_);
    api_->prepare(kernels.jvp, shape_);
  }
}

DeviceDerivativeMachine::~DeviceDerivativeMachine() {
  try {
    api_->await(done_.get());
  } catch (const Error&) {
    return;  // the device is lost, and nothing runs on it
  }
}

/// Queues a launch behind whatever used the scratch last. What is captured is ordered where the graph is launched.
template <class Job>
void DeviceDerivativeMachine::queue(const KernelRef& kernel, const Job& job, StreamHandle stream) {
  if (job.batch.env_count == 0) return;
  const bool capturing = api_->capturing(stream);
  if (!capturing) api_->wait(stream, done_.get());
  const DerivativeArgs<Job> args{job, scratch_, slot_, most_rows_, most_dofs_};
  LaunchShape shape = shape_;
  shape.teams = smaller_of(shape.teams, job.batch.env_count);
  api_->launch(kernel, shape, &args, stream);
  if (!capturing) api_->record(done_.get(), stream);
  if (eager_) api_->synchronize(stream);
}

void DeviceDerivativeMachine::vjp(const VjpJob<float>& job, StreamRef stream) {
  queue(api_->kernels().derivative[0].vjp, job, stream.handle());
}
void DeviceDerivativeMachine::vjp(const VjpJob<double>& job, StreamRef stream) {
  queue(api_->kernels().derivative[1].vjp, job, stream.handle());
}
void DeviceDerivativeMachine::jvp(const JvpJob<float>& job, StreamRef stream) {
  queue(api_->kernels().derivative[0].jvp, job, stream.handle());
}
void DeviceDerivativeMachine::jvp(const JvpJob<double>& job, StreamRef stream) {
  queue(api_->kernels().derivative[1].jvp, job, stream.handle());
}

void DeviceDerivativeMachine::synchronize(StreamRef stream) {
  api_->synchronize(stream.handle());
}

}  // namespace stiction::cuda
