#include "cuda/machine/jacobian_machine.hpp"

#include <algorithm>
#include <utility>
#include <vector>

#include "core/base/extents.hpp"
#include "core/machine/count_captured_call.hpp"
#include "cuda/kernels/jacobian_program.hpp"
#include "cuda/machine/memory_limits.hpp"
#include "stiction/error.hpp"

namespace stiction {

namespace cuda {

namespace {

/// Most fast memory that a team takes for itself: more would leave too few teams at work on a multiprocessor.
constexpr std::size_t kSharedBytes = std::size_t{24} << 10;

/// Lanes for an environment of that size. They reach speed only.
int team_lanes(const JacobianCapacity& capacity) {
  const Index size = larger_of(capacity.env_rows, capacity.env_dofs);
  return size <= 64 ? kWarp : size <= 256 ? 4 * kWarp : kMostLanes;
}

template <class Real>
const JacobianKernels& kernels_of(const DeviceApi& api) {
  return api.kernels().jacobian[sizeof(Real) == sizeof(float) ? 0 : 1];
}

template <class Real>
const VelocityKernels& velocity_kernels_of(const DeviceApi& api) {
  return api.kernels().velocity[sizeof(Real) == sizeof(float) ? 0 : 1];
}

/// The one team that decides where each environment begins.
constexpr LaunchShape kPlacing{1, kMostLanes};

}  // namespace

template <class Real>
DeviceJacobianMachine<Real>::DeviceJacobianMachine(std::shared_ptr<DeviceApi> api, const JacobianCapacity& capacity,
                                                   FactorUse use, bool by_newton, bool lays_out_only)
    : api_(std::move(api)), done_(*api_) {
  arrays_.env_rows = capacity.env_rows;
  arrays_.env_dofs = capacity.env_dofs;
  arrays_.matrix_room = capacity.matrix;
  arrays_.factor_room = capacity.factor;
  arrays_.use = use;
  const Offset vectors = larger_of(capacity.env_rows, 2);
  slot_ = lays_out_only ? 0 : capacity.env_dofs * (capacity.env_dofs + vectors);
  const std::size_t slot_bytes = static_cast<std::size_t>(slot_) * sizeof(Real);
  const bool shared =
      slot_bytes <= kSharedBytes && least_block_bytes(team_lanes(capacity), slot_bytes) <= api_->facts().shared_bytes;
  small_.teams = large_.teams = capacity.envs;
  small_.lanes = kWarp;
  large_.lanes = team_lanes(capacity);
  if (shared) {
    large_.shared_bytes = slot_bytes;
  } else {
    const Offset fitting = larger_of<Offset>(1, most_scratch_bytes(api_->facts()) / static_cast<Offset>(slot_bytes));
    large_.teams = smaller_of(capacity.envs, smaller_of(fitting, kTeamsPerProcessor * api_->facts().processors));
  }

  set_.add(arrays_.flags, capacity.envs);
  set_.add(arrays_.matrix, capacity.envs + 1);
  set_.add(arrays_.factor, capacity.envs + 1);
  set_.add(arrays_.parts, kScanParts);
  set_.add(arrays_.row_offsets, capacity.rows + 1);
  set_.add(arrays_.row_counts, capacity.rows);
  set_.add(arrays_.column_offsets, capacity.rows);
  set_.add(arrays_.column, capacity.env_rows);
  set_.add(arrays_.A, capacity.matrix);
  set_.add(arrays_.Y, capacity.factor);
  set_.add(arrays_.b, capacity.rows);
  if (!shared) set_.add(scratch_, large_.teams * slot_);
  if (by_newton) reserve_newton(capacity);
  memory_ = DeviceMemory(*api_, set_.bytes());
  set_.place(memory_.get());
  if (shared) scratch_ = nullptr;

  std::vector<Index> columns(static_cast<std::size_t>(capacity.env_rows));
  for (std::size_t i = 0; i < columns.size(); ++i) columns[i] = static_cast<Index>(i);
  const Stream stream(*api_);
  try {
    // Row offsets too: of an environment whose rows overlap another's they may never be written, but they are read.
    api_->fill_zero(memory_.get(), memory_.bytes(), stream.get());
    if (!columns.empty())
      api_->copy(arrays_.column, columns.data(), columns.size() * sizeof(Index), CopyKind::to_device, stream.get());
  } catch (const Error&) {
    finish(stream.get());
    throw;
  }
  api_->synchronize(stream.get());
  const JacobianKernels& kernels = kernels_of<Real>(*api_);
  api_->prepare(kernels.count, small_);
  api_->prepare(kernels.place, kPlacing);
  api_->prepare(kernels.write, large_);
  api_->prepare(kernels.move, large_);
  if (by_newton)
    for (const KernelRef& kernel : {newton_kernel_, double_kernel_}) api_->prepare(kernel, newton_shape_);
  if (block_shape_.teams > 0) api_->prepare(velocity_kernels_of<Real>(*api_).newton_in_blocks, block_shape_);
}

/// A lane's numbers are laid out for the largest environment that the method takes.
template <class Real>
void DeviceJacobianMachine<Real>::reserve_newton(const JacobianCapacity& capacity) {
  const bool has_large = capacity.env_dofs > kMostVelocityDofs;
  const VelocityKernels& kernels = velocity_kernels_of<Real>(*api_);
  const auto of_size = [&](const VelocityLanes& lanes) { return has_large ? lanes.in_parts : lanes.whole; };
  newton_kernel_ = of_size(kernels.newton);
  double_kernel_ = sizeof(Real) == sizeof(float) ? of_size(kernels.newton_in_double) : newton_kernel_;
  // Where steps are in double a lane's numbers take more room.
  using InDouble = typename SolveVelocities<Real, double, true>::Types;
  static_cast<LaneRoom&>(newton_) = lay_out_lanes<VelocityWorkspace<InDouble>>(capacity.env_rows, capacity.env_dofs);
  newton_.islands_per_lane = has_large ? DofIslands<Real>::integers(capacity.env_dofs, capacity.env_rows) : 0;
  const Offset lane_bytes = static_cast<Offset>(sizeof(Offset)) * newton_.lists_per_lane +
                            static_cast<Offset>(sizeof(Index)) * newton_.islands_per_lane;
  const Offset team_bytes = static_cast<Offset>(sizeof(double)) * newton_.numbers_per_team + kWarp * lane_bytes;
  const Offset wanted = (capacity.envs + kWarp - 1) / kWarp,
               fitting = larger_of<Offset>(1, most_scratch_bytes(api_->facts()) / team_bytes);
  newton_shape_.teams = smaller_of(wanted, smaller_of(fitting, kTeamsPerProcessor * api_->facts().processors));
  newton_shape_.lanes = kWarp;
  if (has_large) reserve_blocks(capacity);
  set_.add(arrays_.env_row_counts, capacity.envs);
  set_.add(arrays_.env_cone_counts, capacity.envs);
  set_.add(arrays_.answered, capacity.envs);
  set_.add(arrays_.status, capacity.envs);
  set_.add(newton_.numbers, newton_shape_.teams * newton_.numbers_per_team);
  set_.add(newton_.lists, newton_shape_.teams * kWarp * newton_.lists_per_lane);
  set_.add(newton_.islands, newton_shape_.teams * kWarp * newton_.islands_per_lane);
}

/// Memory of the teams that solve in blocks, each of which takes one environment after the other.
template <class Real>
void DeviceJacobianMachine<Real>::reserve_blocks(const JacobianCapacity& capacity) {
  const Index rows = smaller_of(capacity.env_rows, kMostBlockRows);
  const BlockExtent largest{rows, rows, capacity.env_dofs};
  blocks_.lists_per_team = BlockLists::integers(largest);
  blocks_.numbers_per_team = BlockWorkspace::doubles(largest, kWarp);
  const Offset team_bytes = static_cast<Offset>(sizeof(Index)) * blocks_.lists_per_team +
                            static_cast<Offset>(sizeof(double)) * blocks_.numbers_per_team;
  const Offset fitting = larger_of<Offset>(1, most_scratch_bytes(api_->facts()) / team_bytes);
  block_shape_.teams = smaller_of(capacity.envs, smaller_of<Offset>(fitting, api_->facts().processors));
  block_shape_.lanes = kWarp;
  set_.add(blocks_.lists, block_shape_.teams * blocks_.lists_per_team);
  set_.add(blocks_.numbers, block_shape_.teams * blocks_.numbers_per_team);
}

template <class Real>
void DeviceJacobianMachine<Real>::launch_newton(const VelocityJob<Real>& job, StreamHandle stream) {
  VelocityArgs<Real> args = newton_;
  args.job = job;
  args.job.to.status = arrays_.status;
  args.job.answered = arrays_.answered;
  args.arrays = arrays_;
  LaunchShape shape = newton_shape_;
  shape.teams = smaller_of(shape.teams, (job.batch.env_count + kWarp - 1) / kWarp);
  // Tolerances of environments are on the device, so that some of them may ask for steps in double.
  const bool may_ask = job.tolerance < kLeastSingle || job.batch.env_tolerance != nullptr;
  if (sizeof(Real) == sizeof(float) && may_ask) api_->launch(double_kernel_, shape, &args, stream);
  api_->launch(newton_kernel_, shape, &args, stream);
  if (block_shape_.teams == 0) return;
  VelocityBlocksArgs<Real> blocks = blocks_;
  blocks.job = args.job;
  blocks.arrays = arrays_;
  shape = block_shape_;
  shape.teams = smaller_of(shape.teams, job.batch.env_count);
  api_->launch(velocity_kernels_of<Real>(*api_).newton_in_blocks, shape, &blocks, stream);
}

template <class Real>
DeviceJacobianMachine<Real>::~DeviceJacobianMachine() {
  try {
    api_->await(done_.get());
  } catch (const Error&) {
    return;  // the device is lost, and nothing runs on it
  }
}

/// Waits after a failure; the device may be lost.
template <class Real>
void DeviceJacobianMachine<Real>::finish(StreamHandle stream) noexcept {
  try {
    api_->synchronize(stream);
  } catch (const Error&) {
    return;
  }
}

template <class Real>
void DeviceJacobianMachine<Real>::launch(const KernelRef& kernel, const LaunchShape& shape,
                                         const JacobianBatchJob<Real>& job, StreamHandle stream) {
  const JacobianArgs<Real> args{job, scratch_, slot_};
  LaunchShape own = shape;
  own.teams = smaller_of(shape.teams, job.batch.env_count);
  api_->launch(kernel, own, &args, stream);
}

/// Queues work on the arrays behind whatever used them last. What is captured is ordered where the graph is launched.
template <class Real>
template <class Work>
void DeviceJacobianMachine<Real>::queue(StreamHandle stream, const Work& work) {
  const bool capturing = api_->capturing(stream);
  if (capturing) count_captured_call();
  try {
    if (!capturing) api_->wait(stream, done_.get());
    work();
    if (!capturing) api_->record(done_.get(), stream);
  } catch (const Error&) {
    // Whatever was queued before the failure must not run on while the caller takes its memory back.
    if (!capturing) finish(stream);
    throw;
  }
}

template <class Real>
bool DeviceJacobianMachine<Real>::solve_velocities(const VelocityJob<Real>& job, StreamRef stream) {
  is_counted_ = true;
  if (job.batch.env_count > 0)
    queue(stream.handle(), [&] {
      launch(kernels_of<Real>(*api_).count, small_, JacobianBatchJob<Real>{job.batch, arrays_}, stream.handle());
      launch_newton(job, stream.handle());
    });
  return false;  // the host does not wait to know
}

template <class Real>
ContactBatchView<Real> DeviceJacobianMachine<Real>::assemble(const JacobianBatchView<Real>& batch, StreamRef stream) {
  const JacobianKernels& kernels = kernels_of<Real>(*api_);
  const JacobianBatchJob<Real> job{batch, arrays_};
  const bool is_counted = std::exchange(is_counted_, false);
  if (batch.env_count > 0)
    queue(stream.handle(), [&] {
      if (!is_counted) launch(kernels.count, small_, job, stream.handle());
      launch(kernels.place, kPlacing, job, stream.handle());
      launch(kernels.write, large_, job, stream.handle());
    });
  return contact_view(batch, arrays_);
}

template <class Real>
JacobianBatchJob<Real> DeviceJacobianMachine<Real>::lay_out(const JacobianBatchView<Real>& batch, StreamRef stream) {
  const JacobianKernels& kernels = kernels_of<Real>(*api_);
  const JacobianBatchJob<Real> job{batch, arrays_};
  if (batch.env_count > 0)
    queue(stream.handle(), [&] {
      launch(kernels.count, small_, job, stream.handle());
      launch(kernels.place, kPlacing, job, stream.handle());
    });
  return job;
}

template <class Real>
void DeviceJacobianMachine<Real>::write(const JacobianBatchView<Real>& batch,
                                        const JacobianSolutionView<Real>& solution, StreamRef stream) {
  const JacobianBatchJob<Real> job{batch, arrays_, solution.lambda, solution.status, solution.velocity};
  queue(stream.handle(), [&] {
    if (batch.env_count > 0 && (solution.velocity != nullptr || arrays_.answered != nullptr))
      launch(kernels_of<Real>(*api_).move, large_, job, stream.handle());
  });
}

template class DeviceJacobianMachine<float>;
template class DeviceJacobianMachine<double>;

}  // namespace cuda

}  // namespace stiction
