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

/// Stands for every type of team in sizes.
struct EveryTeam : SerialTeam {};

/// Most fast memory that such teams can have on a device, if a block is as small as it may be.
std::size_t most_shared_bytes(const DeviceFacts& facts, int lanes) {
  const auto teams = static_cast<std::size_t>(lanes < kWarp ? kWarp / lanes : 1);
  return (facts.shared_bytes / teams - kTeamBytes) / 16 * 16;
}

/// The one team that decides where each environment begins.
constexpr LaunchShape kPlacing{1, kMostLanes};

}  // namespace

template <class Real>
DeviceJacobianMachine<Real>::DeviceJacobianMachine(std::shared_ptr<DeviceApi> api, const JacobianCapacity& capacity,
                                                   FactorUse use, bool by_newton, bool lays_out_only,
                                                   const VelocityRules& rules)
    : api_(std::move(api)), rules_(rules), done_(*api_) {
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
  if (by_newton) prepare_newton();
}

template <class Real>
bool DeviceJacobianMachine<Real>::are_many(Offset envs) const {
  return envs >= rules_.many_per_processor * api_->facts().processors;
}

template <class Real>
void DeviceJacobianMachine<Real>::prepare_newton() {
  const VelocityKernels& kernels = velocity_kernels_of<Real>(*api_);
  for (const VelocityStepKernels* steps : {&kernels.steps, &kernels.steps_in_double}) {
    if (steps->teams.entry == nullptr) continue;
    for (const LaunchShape& shape : team_shapes_) api_->prepare(steps->teams, shape);
    if (lane_shape_.teams > 0) api_->prepare(has_large_ ? steps->in_parts : steps->lanes, lane_shape_);
  }
  if (block_shape_.teams > 0) api_->prepare(kernels.in_blocks, block_shape_);
}

/// Teams have memory of their own, within the device's. A lane's numbers are laid out for the largest
/// environment.
template <class Real>
void DeviceJacobianMachine<Real>::reserve_newton(const JacobianCapacity& capacity) {
  has_large_ = capacity.env_dofs > kMostVelocityDofs;
  set_.add(arrays_.env_row_counts, capacity.envs);
  set_.add(arrays_.env_cone_counts, capacity.envs);
  set_.add(arrays_.answered, capacity.envs);
  set_.add(arrays_.status, capacity.envs);
  set_.add(left_, 1);
  rest_.emplace(*api_);
  if (has_large_) reserve_blocks(capacity);
  // Numbers take more room where steps are in double.
  using TeamTypes = LaneTypes<double, 1, DofSet, Real, EveryTeam>;
  bool covers_all = false;
  for (const VelocityTeamLimits& limits : kVelocityTeams) {
    if (covers_all) break;
    const std::size_t most = most_team_bytes<TeamTypes>(capacity.env_rows, capacity.env_dofs, limits.lanes);
    const std::size_t room = smaller_of(smaller_of(most, limits.bytes), most_shared_bytes(api_->facts(), limits.lanes));
    team_shapes_.push_back({capacity.envs, limits.lanes, room});
    covers_all = room == most;
  }
  if (covers_all && !has_large_ && !are_many(capacity.envs)) return;
  using InDouble = typename SolveVelocities<Real, double, true>::Types;
  static_cast<LaneRoom&>(newton_) = lay_out_lanes<VelocityWorkspace<InDouble>>(capacity.env_rows, capacity.env_dofs);
  newton_.islands_per_lane = has_large_ ? DofIslands<Real>::integers(capacity.env_dofs, capacity.env_rows) : 0;
  const Offset lane_bytes = static_cast<Offset>(sizeof(Offset)) * newton_.lists_per_lane +
                            static_cast<Offset>(sizeof(Index)) * newton_.islands_per_lane;
  const Offset team_bytes = static_cast<Offset>(sizeof(double)) * newton_.numbers_per_team + kWarp * lane_bytes;
  const Offset wanted = (capacity.envs + kWarp - 1) / kWarp,
               fitting = larger_of<Offset>(1, most_scratch_bytes(api_->facts()) / team_bytes);
  lane_shape_.teams = smaller_of(wanted, smaller_of(fitting, kTeamsPerProcessor * api_->facts().processors));
  lane_shape_.lanes = kWarp;
  set_.add(newton_.numbers, lane_shape_.teams * newton_.numbers_per_team);
  set_.add(newton_.lists, lane_shape_.teams * kWarp * newton_.lists_per_lane);
  set_.add(newton_.islands, lane_shape_.teams * kWarp * newton_.islands_per_lane);
}

/// Memory of the teams that solve in blocks, each of which takes one environment after the other.
template <class Real>
void DeviceJacobianMachine<Real>::reserve_blocks(const JacobianCapacity& capacity) {
  const Index rows = smaller_of(capacity.env_rows, kMostRowsInBlocks);
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
  const VelocityKernels& kernels = velocity_kernels_of<Real>(*api_);
  VelocityJob<Real> own = job;
  own.to.status = arrays_.status;
  own.answered = arrays_.answered;
  // Tolerances of environments are on the device, so that some of them may ask for steps in double.
  const bool may_ask = job.tolerance < kLeastSingle || job.batch.env_tolerance != nullptr;
  if (sizeof(Real) == sizeof(float) && may_ask) launch_steps(kernels.steps_in_double, own, stream);
  launch_steps(kernels.steps, own, stream);
  if (block_shape_.teams == 0) return;
  VelocityBlocksArgs<Real> blocks = blocks_;
  blocks.job = own;
  blocks.arrays = arrays_;
  LaunchShape shape = block_shape_;
  shape.teams = smaller_of(shape.teams, job.batch.env_count);
  api_->launch(kernels.in_blocks, shape, &blocks, stream);
}

template <class Real>
void DeviceJacobianMachine<Real>::launch_steps(const VelocityStepKernels& kernels, const VelocityJob<Real>& job,
                                               StreamHandle stream) {
  for (LaunchShape shape : team_shapes_) {
    if (are_many(job.batch.env_count)) break;
    const VelocityTeamArgs<Real> args{job, arrays_, static_cast<Offset>(shape.shared_bytes)};
    shape.teams = smaller_of(shape.teams, job.batch.env_count);
    api_->launch(kernels.teams, shape, &args, stream);
  }
  if (lane_shape_.teams == 0) return;
  VelocityArgs<Real> args = newton_;
  args.job = job;
  args.arrays = arrays_;
  LaunchShape shape = lane_shape_;
  shape.teams = smaller_of(shape.teams, (job.batch.env_count + kWarp - 1) / kWarp);
  api_->launch(has_large_ ? kernels.in_parts : kernels.lanes, shape, &args, stream);
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
  const JacobianArgs<Real> args{job, scratch_, slot_, left_, false};
  LaunchShape own = shape;
  own.teams = smaller_of(shape.teams, job.batch.env_count);
  api_->launch(kernel, own, &args, stream);
}

/// Queues work on the arrays behind whatever used them last. Captured work is ordered where the graph is launched.
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

/// Only a graph can leave work out: elsewhere nothing is to be found.
template <class Real>
void DeviceJacobianMachine<Real>::queue_rest(const JacobianBatchView<Real>& batch, StreamRef stream,
                                             const std::function<void(StreamRef)>& rest) {
  if (!is_counted_ || !rest_.has_value() || !api_->capturing(stream.handle())) {
    rest(stream);
    return;
  }
  const JacobianArgs<Real> args{{batch, arrays_}, nullptr, 0, left_, true};
  LaunchShape shape = small_;
  shape.teams = (batch.env_count + shape.lanes - 1) / shape.lanes;
  api_->launch(kernels_of<Real>(*api_).count, shape, &args, stream.handle());
  api_->conditionally(left_, stream.handle(), rest_->get(), [&](StreamHandle inner) { rest(StreamRef(inner)); });
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
