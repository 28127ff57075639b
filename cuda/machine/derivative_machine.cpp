#include "cuda/machine/derivative_machine.hpp"

#include <utility>

#include "core/base/extents.hpp"
#include "core/machine/count_captured_call.hpp"
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
                                                 const DerivativeOptions& options, bool eager)
    : api_(std::move(api)),
      eager_(eager),
      kappa_(options.kappa),
      most_rows_(capacity.env_rows),
      most_dofs_(capacity.env_dofs),
      most_nonzeros_(capacity.env_nonzeros),
      slot_(derivative_elements(capacity.env_rows, capacity.env_rows, capacity.env_dofs,
                                smaller_of(capacity.env_rows, options.max_unknowns)) +
            (kappa_ > 0.0 ? relaxed_vectors(capacity.env_rows) : 0) + jacobian_doubles(capacity)),
      done_(*api_) {
  shape_.teams = teams_for(slot_);
  if (capacity.envs > 0) shape_.teams = smaller_of(shape_.teams, capacity.envs);
  shape_.lanes = team_lanes(capacity.env_rows);
  set_.add(scratch_, shape_.teams * slot_);
  memory_ = DeviceMemory(*api_, set_.bytes());
  set_.place(memory_.get());
  if (kappa_ > 0.0) relaxed_.make_room(*api_, static_cast<std::size_t>(capacity.rows) * sizeof(double));
  for (const Precision precision : {Precision::f32, Precision::f64}) {
    api_->prepare(kernels(precision).vjp, shape_);
    api_->prepare(kernels(precision).jvp, shape_);
    api_->prepare(unrolled_kernel(precision), shape_);
  }
}

DeviceDerivativeMachine::~DeviceDerivativeMachine() {
  try {
    api_->await(done_.get());
  } catch (const Error&) {
    return;  // the device is lost, and nothing runs on it
  }
}

/// Kernels of the problem that is differentiated.
const DerivativePair& DeviceDerivativeMachine::kernels(Precision precision) const {
  const DerivativeKernels& all = api_->kernels().derivative[static_cast<int>(precision)];
  return kappa_ > 0.0 ? all.relaxed : all.exact;
}
const KernelRef& DeviceDerivativeMachine::unrolled_kernel(Precision precision) const {
  return api_->kernels().derivative[static_cast<int>(precision)].unrolled_vjp;
}

/// Memory for as many doubles. Graphs that were captured keep what they have, so that it cannot move any more.
void DeviceDerivativeMachine::make_room(DeviceMemory& memory, Offset doubles, StreamHandle stream) {
  const auto bytes = static_cast<std::size_t>(doubles) * sizeof(double);
  const bool capturing = api_->capturing(stream);
  if (memory.bytes() < bytes) {
    if (capturing || captured_)
      throw Error(ErrorCode::invalid_argument,
                  "this call needs more room than those before, and the stream is captured or a graph holds the room "
                  "there is: make one call of its size before the capture, or give a Derivative of its own");
    api_->await(done_.get());
    memory.make_room(*api_, bytes);
  }
  captured_ = captured_ || capturing;
}

/// Teams whose scratch of that many doubles fits.
Offset DeviceDerivativeMachine::teams_for(Offset slot) const {
  const Offset fitting = larger_of<Offset>(1, kScratchBytes / (slot * static_cast<Offset>(sizeof(double))));
  return smaller_of(fitting, kTeamsPerProcessor * api_->facts().processors);
}

/// Queues a launch behind whatever used the scratch last. What is captured is ordered where the graph is launched.
template <class Args>
void DeviceDerivativeMachine::queue(const KernelRef& kernel, const Args& args, Offset teams, StreamHandle stream) {
  const bool capturing = api_->capturing(stream);
  if (capturing) count_captured_call();
  if (!capturing) api_->wait(stream, done_.get());
  LaunchShape shape = shape_;
  shape.teams = smaller_of(teams, args.job.job.contact.batch.env_count);
  api_->launch(kernel, shape, &args, stream);
  if (!capturing) api_->record(done_.get(), stream);
  if (eager_) api_->synchronize(stream);
}

template <class Program, class Job>
void DeviceDerivativeMachine::queue_job(const KernelRef& kernel, const Job& job, StreamHandle stream) {
  if (kappa_ > 0.0) make_room(relaxed_, job.contact.batch.row_count, stream);
  typename Program::Args args{};
  args.job = {job, kappa_, reinterpret_cast<decltype(args.job.lambda)>(relaxed_.get())};
  args.scratch = scratch_;
  args.slot = slot_;
  args.most_rows = most_rows_;
  args.most_dofs = most_dofs_;
  queue(kernel, args, shape_.teams, stream);
}

/// Derivatives of a contact batch.
template <class Program, class Job, class Contact>
void DeviceDerivativeMachine::queue_contacts(const KernelRef& kernel, const Contact& contact, StreamHandle stream) {
  if (contact.batch.env_count == 0) return;
  Job job{};
  job.contact = contact;
  job.has_jacobian = false;
  queue_job<Program>(kernel, job, stream);
}

/// Derivatives of a batch of J and M, which is laid out first.
template <class Program, class Real, class Job>
void DeviceDerivativeMachine::queue_jacobians(JacobianRoom<Real>& room, const KernelRef& kernel, Job job,
                                              StreamHandle stream) {
  const JacobianBatchView<Real> batch = job.assembly.batch;
  if (batch.env_count == 0) return;
  make_room(room, batch, job.contact.count, stream);
  if (!api_->capturing(stream)) api_->wait(stream, done_.get());
  job.connect(room.machine->lay_out(batch, StreamRef(stream)), room.in, room.out);
  queue_job<Program>(kernel, job, stream);
}

/// Sweeps of a contact batch, in scratch of their own that grows with their number.
template <class Real>
void DeviceDerivativeMachine::queue_sweeps(const KernelRef& kernel, const UnrolledJob<Real>& job, StreamHandle stream) {
  if (job.batch.env_count == 0) return;
  typename PullSweeps<Real>::Args args{};
  args.job.job.contact = job;
  args.job.job.has_jacobian = false;
  args.sweeps = job.sweeps;
  args.most_rows = most_rows_;
  args.most_dofs = most_dofs_;
  const Index rows = smaller_of(most_rows_, job.max_unknowns);
  args.slot = unrolled_slot(rows, rows, job.sweeps.count, most_nonzeros_);
  const Offset teams = smaller_of(teams_for(args.slot), job.batch.env_count);
  make_room(tapes_, teams * args.slot, stream);
  args.scratch = reinterpret_cast<double*>(tapes_.get());
  queue(kernel, args, teams, stream);
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
  queue_contacts<PullBack<float, false>, JacobianVjpJob<float>>(kernels(Precision::f32).vjp, job, stream.handle());
}
void DeviceDerivativeMachine::vjp(const VjpJob<double>& job, StreamRef stream) {
  queue_contacts<PullBack<double, false>, JacobianVjpJob<double>>(kernels(Precision::f64).vjp, job, stream.handle());
}
void DeviceDerivativeMachine::jvp(const JvpJob<float>& job, StreamRef stream) {
  queue_contacts<PushForward<float, false>, JacobianJvpJob<float>>(kernels(Precision::f32).jvp, job, stream.handle());
}
void DeviceDerivativeMachine::jvp(const JvpJob<double>& job, StreamRef stream) {
  queue_contacts<PushForward<double, false>, JacobianJvpJob<double>>(kernels(Precision::f64).jvp, job, stream.handle());
}
void DeviceDerivativeMachine::vjp(const JacobianVjpJob<float>& job, StreamRef stream) {
  queue_jacobians<PullBack<float, false>>(floats_, kernels(Precision::f32).vjp, job, stream.handle());
}
void DeviceDerivativeMachine::vjp(const JacobianVjpJob<double>& job, StreamRef stream) {
  queue_jacobians<PullBack<double, false>>(doubles_, kernels(Precision::f64).vjp, job, stream.handle());
}
void DeviceDerivativeMachine::jvp(const JacobianJvpJob<float>& job, StreamRef stream) {
  queue_jacobians<PushForward<float, false>>(floats_, kernels(Precision::f32).jvp, job, stream.handle());
}
void DeviceDerivativeMachine::jvp(const JacobianJvpJob<double>& job, StreamRef stream) {
  queue_jacobians<PushForward<double, false>>(doubles_, kernels(Precision::f64).jvp, job, stream.handle());
}

void DeviceDerivativeMachine::unrolled_vjp(const UnrolledJob<float>& job, StreamRef stream) {
  queue_sweeps(unrolled_kernel(Precision::f32), job, stream.handle());
}
void DeviceDerivativeMachine::unrolled_vjp(const UnrolledJob<double>& job, StreamRef stream) {
  queue_sweeps(unrolled_kernel(Precision::f64), job, stream.handle());
}

void DeviceDerivativeMachine::synchronize(StreamRef stream) {
  api_->synchronize(stream.handle());
}

}  // namespace stiction::cuda
