#include "cuda/machine/derivative_machine.hpp"

#include <type_traits>
#include <utility>

#include "core/base/extents.hpp"
#include "core/machine/count_captured_call.hpp"
#include "cuda/kernels/derivative_program.hpp"
#include "cuda/machine/memory_limits.hpp"
#include "stiction/error.hpp"

namespace stiction::cuda {

namespace {

/// Returns the further doubles of the largest environment of J and M, in either precision.
Offset jacobian_doubles(const Capacity& capacity) {
  const Offset dofs = capacity.env_dofs,
               vectors = larger_of(capacity.env_rows, 2) + ChainEnv<RowTile<double>>::kVectors;
  return dofs * (dofs + vectors);
}

[[noreturn]] void refuse_to_grow() {
  throw Error(ErrorCode::invalid_argument,
              "this call needs more room than those before, and the stream is captured or a graph holds the room there "
              "is: make one call of its size before the capture, or give a Derivative of its own");
}

/// A team of lanes each of which takes an environment.
LaunchShape lanes_shape() {
  LaunchShape shape;
  shape.teams = 1;
  shape.lanes = kWarp;
  return shape;
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
    api_->prepare(lanes_kernel(precision), lanes_shape());
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
const KernelRef& DeviceDerivativeMachine::lanes_kernel(Precision precision) const {
  return api_->kernels().derivative[static_cast<int>(precision)].lanes;
}

/// Memory for as many doubles. Graphs that were captured keep their memory, so that it cannot move any more.
void DeviceDerivativeMachine::make_room(DeviceMemory& memory, Offset doubles, StreamHandle stream) {
  const auto bytes = static_cast<std::size_t>(doubles) * sizeof(double);
  const bool capturing = api_->capturing(stream);
  if (memory.bytes() < bytes) {
    if (capturing || captured_) refuse_to_grow();
    api_->await(done_.get());
    memory.make_room(*api_, bytes);
  }
  captured_ = captured_ || capturing;
}

/// Teams whose scratch of that many doubles fits.
Offset DeviceDerivativeMachine::teams_for(Offset slot) const {
  const Offset fitting =
      larger_of<Offset>(1, most_scratch_bytes(api_->facts()) / (slot * static_cast<Offset>(sizeof(double))));
  return smaller_of(fitting, kTeamsPerProcessor * api_->facts().processors);
}

/// Queues a launch behind whatever used the scratch last. Captured work is ordered where the graph is launched.
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
void DeviceDerivativeMachine::queue_job(const KernelRef& kernel, const Job& job, StreamHandle stream,
                                        const std::uint8_t* written) {
  if (kappa_ > 0.0) make_room(relaxed_, job.contact.batch.row_count, stream);
  typename Program::Args args{};
  args.job = {job, kappa_, reinterpret_cast<decltype(args.job.lambda)>(relaxed_.get())};
  args.scratch = scratch_;
  args.slot = slot_;
  args.most_rows = most_rows_;
  args.most_dofs = most_dofs_;
  args.written = written;
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
  const bool has_lanes = kappa_ == 0.0 && job.contact.law == Law::convex && room.teams > 0;
  if (has_lanes) queue_lanes(room, job, stream);
  const bool is_forward = std::is_same_v<Job, JacobianJvpJob<Real>>;
  queue_job<Program>(kernel, job, stream, has_lanes && is_forward ? room.lanes.answered : nullptr);
}

/// Lanes differentiate their environments. In reverse, the job then has those they answered.
template <class Real, class Job>
void DeviceDerivativeMachine::queue_lanes(const JacobianRoom<Real>& room, Job& job, StreamHandle stream) {
  JacobianLanesArgs<Real> args = room.args;
  args.answered = room.lanes.answered;
  if constexpr (std::is_same_v<Job, JacobianVjpJob<Real>>) {
    job.lanes = room.lanes;
    args.job = job;
  } else {
    args.forward = job;
    args.is_forward = true;
  }
  LaunchShape shape = lanes_shape();
  shape.teams = smaller_of(room.teams, (job.assembly.batch.env_count + kWarp - 1) / kWarp);
  api_->launch(lanes_kernel(sizeof(Real) == sizeof(float) ? Precision::f32 : Precision::f64), shape, &args, stream);
}

/// Sweeps of a contact batch, in scratch of their own that grows with their number.
template <class Real>
void DeviceDerivativeMachine::queue_sweeps(const KernelRef& kernel, const UnrolledJob<Real>& job, StreamHandle stream) {
  if (job.batch.env_count == 0) return;
  typename UnrolledVjpProgram<Real>::Args args{};
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

/// Makes the memory of lanes for environments of this machine's capacity.
template <class Real>
void DeviceDerivativeMachine::add_lanes(JacobianRoom<Real>& room, const JacobianNumbers& numbers, ArraySet& set) const {
  static_cast<LaneRoom&>(room.args) =
      lay_out_lanes<JacobianPackWorkspace<typename DerivativeLanesProgram<Real>::Types>>(most_rows_, most_dofs_);
  room.args.islands_per_lane =
      most_dofs_ > kMostVelocityDofs ? DofIslands<Real>::integers(most_dofs_, most_rows_) : Offset{0};
  const Offset lists = kWarp * room.args.lists_per_lane, islands = kWarp * room.args.islands_per_lane;
  const Offset wanted = (room.capacity.envs + kWarp - 1) / kWarp;
  room.teams = smaller_of(wanted, teams_for(room.args.numbers_per_team + lists + islands));
  set.add(room.lanes.moved, numbers.dofs);
  set.add(room.lanes.adjoint, numbers.adjoints);
  set.add(room.lanes.answered, room.capacity.envs);
  set.add(room.args.numbers, room.teams * room.args.numbers_per_team);
  set.add(room.args.lists, room.teams * lists);
  set.add(room.args.islands, room.teams * islands);
}

/// Room for the batch, whose environments are within the derivative's capacity: larger ones get none.
template <class Real>
void DeviceDerivativeMachine::make_room(JacobianRoom<Real>& room, const JacobianBatchView<Real>& batch, Offset count,
                                        StreamHandle stream) {
  const JacobianNumbers need{count * batch.row_count, count * batch.dof_count, batch.dof_count};
  const JacobianCapacity& has = room.capacity;
  const bool fits = has.envs >= batch.env_count && has.rows >= batch.row_count && has.cones >= batch.cone_count;
  const bool capturing = api_->capturing(stream);
  if (room.machine != nullptr && fits && room.has.holds(need)) {
    captured_ = captured_ || capturing;
    return;
  }
  if (capturing || captured_) refuse_to_grow();
  api_->await(done_.get());
  if (room.machine == nullptr || !fits) {
    JacobianCapacity larger;
    larger.envs = larger_of(has.envs, batch.env_count);
    larger.rows = larger_of(has.rows, batch.row_count);
    larger.cones = larger_of(has.cones, batch.cone_count);
    larger.env_rows = most_rows_;
    larger.env_dofs = most_dofs_;
    larger.matrix = larger.rows * most_rows_;
    larger.factor = larger.rows * most_dofs_;
    room.capacity = {};
    room.machine.reset();
    room.machine = std::make_unique<DeviceJacobianMachine<Real>>(api_, larger, FactorUse::by_size, false, true);
    room.capacity = larger;
  }
  JacobianNumbers most = room.has;
  most.take_in(need);
  room.has = {};
  ArraySet set;
  set.add(room.in, most.rows);
  set.add(room.out, most.rows);
  if (kappa_ == 0.0 && most_dofs_ > 0) add_lanes(room, most, set);
  room.memory.make_room(*api_, set.bytes());
  set.place(room.memory.get());
  room.has = most;
}

void DeviceDerivativeMachine::vjp(const VjpJob<float>& job, StreamRef stream) {
  queue_contacts<VjpProgram<float, false>, JacobianVjpJob<float>>(kernels(Precision::f32).vjp, job, stream.handle());
}
void DeviceDerivativeMachine::vjp(const VjpJob<double>& job, StreamRef stream) {
  queue_contacts<VjpProgram<double, false>, JacobianVjpJob<double>>(kernels(Precision::f64).vjp, job, stream.handle());
}
void DeviceDerivativeMachine::jvp(const JvpJob<float>& job, StreamRef stream) {
  queue_contacts<JvpProgram<float, false>, JacobianJvpJob<float>>(kernels(Precision::f32).jvp, job, stream.handle());
}
void DeviceDerivativeMachine::jvp(const JvpJob<double>& job, StreamRef stream) {
  queue_contacts<JvpProgram<double, false>, JacobianJvpJob<double>>(kernels(Precision::f64).jvp, job, stream.handle());
}
void DeviceDerivativeMachine::vjp(const JacobianVjpJob<float>& job, StreamRef stream) {
  queue_jacobians<VjpProgram<float, false>>(floats_, kernels(Precision::f32).vjp, job, stream.handle());
}
void DeviceDerivativeMachine::vjp(const JacobianVjpJob<double>& job, StreamRef stream) {
  queue_jacobians<VjpProgram<double, false>>(doubles_, kernels(Precision::f64).vjp, job, stream.handle());
}
void DeviceDerivativeMachine::jvp(const JacobianJvpJob<float>& job, StreamRef stream) {
  queue_jacobians<JvpProgram<float, false>>(floats_, kernels(Precision::f32).jvp, job, stream.handle());
}
void DeviceDerivativeMachine::jvp(const JacobianJvpJob<double>& job, StreamRef stream) {
  queue_jacobians<JvpProgram<double, false>>(doubles_, kernels(Precision::f64).jvp, job, stream.handle());
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
