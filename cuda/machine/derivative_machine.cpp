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

/// What the largest environment of J and M takes beside, in either precision.
Offset jacobian_doubles(const Capacity& capacity) {
  const Offset dofs = capacity.env_dofs,
               vectors = larger_of(capacity.env_rows, 2) + ChainEnv<RowTile<double>>::kVectors;
  return dofs * (dofs + vectors);
}

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
                                smaller_of(capacity.env_rows, max_unknowns)) +
            jacobian_doubles(capacity)),
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
  const bool capturing = api_->capturing(stream);
  if (!capturing) api_->wait(stream, done_.get());
  const DerivativeArgs<Job> args{job, scratch_, slot_, most_rows_, most_dofs_};
  LaunchShape shape = shape_;
  shape.teams = smaller_of(shape.teams, job.contact.batch.env_count);
  api_->launch(kernel, shape, &args, stream);
  if (!capturing) api_->record(done_.get(), stream);
  if (eager_) api_->synchronize(stream);
}

/// Derivatives of a contact batch.
template <class Job, class Contact>
void DeviceDerivativeMachine::queue_contacts(const KernelRef& kernel, const Contact& contact, StreamHandle stream) {
  if (contact.batch.env_count == 0) return;
  Job job{};
  job.contact = contact;
  job.has_jacobian = false;
  queue(kernel, job, stream);
}

/// Derivatives of a batch of J and M, which is laid out first.
template <class Real, class Job>
void DeviceDerivativeMachine::queue_jacobians(JacobianRoom<Real>& room, const KernelRef& kernel, Job job,
                                              StreamHandle stream) {
  const JacobianBatchView<Real> batch = job.assembly.batch;
  if (batch.env_count == 0) return;
  make_room(room, batch, job.contact.count, stream);
  if (!api_->capturing(stream)) api_->wait(stream, done_.get());
  job.connect(room.machine->lay_out(batch, StreamRef(stream)), room.in, room.out);
  queue(kernel, job, stream);
}

/// Room for the batch, whose environments are no larger than the derivative's capacity says: larger ones get none.
template <class Real>
void DeviceDerivativeMachine::make_room(JacobianRoom<Real>& room, const JacobianBatchView<Real>& batch, Offset count,
                                        StreamHandle stream) {
  const Offset numbers = count * batch.row_count;
  const JacobianCapacity& has = room.capacity;
  const bool fits = has.envs >= batch.env_count && has.rows >= batch.row_count && has.cones >= batch.cone_count;
  if (room.machine != nullptr && fits && room.numbers >= numbers) return;
  if (api_->capturing(stream))
    throw Error(ErrorCode::invalid_argument,
                "the stream is captured, and this batch of J and M needs more room than those before: differentiate "
                "one of its size before the capture");
  api_->await(done_.get());
  if (room.machine == nullptr || !fits) {
    JacobianCapacity need;
    need.envs = larger_of(has.envs, batch.env_count);
    need.rows = larger_of(has.rows, batch.row_count);
    need.cones = larger_of(has.cones, batch.cone_count);
    need.env_rows = most_rows_;
    need.env_dofs = most_dofs_;
    need.matrix = need.rows * most_rows_;
    need.factor = need.rows * most_dofs_;
    room.capacity = {};
    room.machine.reset();
    room.machine = std::make_unique<DeviceJacobianMachine<Real>>(api_, need, FactorUse::by_size, false, true);
    room.capacity = need;
  }
  if (room.numbers >= numbers) return;
  room.numbers = 0;
  ArraySet set;
  set.add(room.in, numbers);
  set.add(room.out, numbers);
  room.memory.make_room(*api_, set.bytes());
  set.place(room.memory.get());
  room.numbers = numbers;
}

void DeviceDerivativeMachine::vjp(const VjpJob<float>& job, StreamRef stream) {
  queue_contacts<JacobianVjpJob<float>>(api_->kernels().derivative[0].vjp, job, stream.handle());
}
void DeviceDerivativeMachine::vjp(const VjpJob<double>& job, StreamRef stream) {
  queue_contacts<JacobianVjpJob<double>>(api_->kernels().derivative[1].vjp, job, stream.handle());
}
void DeviceDerivativeMachine::jvp(const JvpJob<float>& job, StreamRef stream) {
  queue_contacts<JacobianJvpJob<float>>(api_->kernels().derivative[0].jvp, job, stream.handle());
}
void DeviceDerivativeMachine::jvp(const JvpJob<double>& job, StreamRef stream) {
  queue_contacts<JacobianJvpJob<double>>(api_->kernels().derivative[1].jvp, job, stream.handle());
}
void DeviceDerivativeMachine::vjp(const JacobianVjpJob<float>& job, StreamRef stream) {
  queue_jacobians(floats_, api_->kernels().derivative[0].vjp, job, stream.handle());
}
void DeviceDerivativeMachine::vjp(const JacobianVjpJob<double>& job, StreamRef stream) {
  queue_jacobians(doubles_, api_->kernels().derivative[1].vjp, job, stream.handle());
}
void DeviceDerivativeMachine::jvp(const JacobianJvpJob<float>& job, StreamRef stream) {
  queue_jacobians(floats_, api_->kernels().derivative[0].jvp, job, stream.handle());
}
void DeviceDerivativeMachine::jvp(const JacobianJvpJob<double>& job, StreamRef stream) {
  queue_jacobians(doubles_, api_->kernels().derivative[1].jvp, job, stream.handle());
}

void DeviceDerivativeMachine::synchronize(StreamRef stream) {
  api_->synchronize(stream.handle());
}

}  // namespace stiction::cuda
