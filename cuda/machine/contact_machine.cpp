#include "cuda/machine/contact_machine.hpp"

#include <algorithm>
#include <string>
#include <utility>

#include "core/base/extents.hpp"
#include "stiction/error.hpp"

namespace stiction {

namespace cuda {

namespace {

/// The least room for the environments of a plan.
Capacity capacity_of(const PlanData& plan) {
  Capacity need;
  need.envs = plan.env_count;
  need.rows = plan.row_count;
  need.cones = plan.cone_count;
  need.nonzeros = plan.nonzero_count;
  for (const ConeCounts& counts : plan.counts) {
    need.env_rows = larger_of(need.env_rows, row_count(counts));
    need.semidefinite = need.semidefinite || counts.semidefinite > 0;
  }
  for (const Offset entries : plan.sparse_nonzeros) need.env_nonzeros = larger_of(need.env_nonzeros, entries);
  need.env_dofs = plan.most_dofs;
  return need;
}

bool same_owner(const std::weak_ptr<const PlanData>& a, const std::weak_ptr<const PlanData>& b) {
  return !a.owner_before(b) && !b.owner_before(a);
}

}  // namespace

DeviceContactMachine::DeviceContactMachine(std::shared_ptr<DeviceApi> api, Offset piece_bytes, const ClassRules& rules)
    : api_(std::move(api)), engine_(*api_, rules), staging_(*api_, engine_, piece_bytes) {}

void DeviceContactMachine::reserve(const Capacity& capacity, SolverKind solver) {
  const std::lock_guard lock(mutex_);
  engine_.reserve(capacity, solver, capacity.precision);
}

void DeviceContactMachine::synchronize(StreamRef stream) {
  api_->synchronize(stream.handle());
  const std::lock_guard lock(mutex_);
  engine_.timer().collect();
}

void DeviceContactMachine::copy_to_host(void* target, const void* source, std::size_t bytes, StreamRef stream) {
  api_->copy(target, source, bytes, CopyKind::to_host, stream.handle());
  api_->synchronize(stream.handle());
}

template <class Real>
void DeviceContactMachine::run(const SolveRequest<Real>& request) {
  const std::lock_guard lock(mutex_);
  if (request.batch.space == MemorySpace::cuda) {
    run_on_device(request);
    return;
  }
  planned_.reset();
  engine_.reserve(Capacity::of(request.batch), request.options.solver, kPrecisionOf<Real>);
  staging_.solve(request);
}

template <class Real>
void DeviceContactMachine::run_on_device(const SolveRequest<Real>& request) {
  const ContactBatchView<Real>& batch = request.batch;
  const bool capturing = api_->capturing(request.stream.handle());
  const Capacity need =
      request.plan != nullptr
          ? capacity_of(*request.plan)
          : Capacity{batch.env_count,   batch.row_count, batch.cone_count, batch.nonzero_count, 0, 0, 0,
                     kPrecisionOf<Real>};
  if (!engine_.has_reserved(need, request.options.solver, kPrecisionOf<Real>)) {
    if (request.plan == nullptr || capturing)
      throw Error(ErrorCode::invalid_argument,
                  "batch has " + std::to_string(batch.env_count) + " environments, " + std::to_string(batch.row_count) +
                      " rows, " + std::to_string(batch.cone_count) + " cones and " +
                      std::to_string(batch.nonzero_count) +
                      " entries, more than the solver has room for (or its precision is wider): construct the Solver "
                      "with that Capacity, or solve once with a plan before capturing");
    // With the entries of dense environments, which are not more than full: finding islands looks at those too.
    Capacity wanted = need;
    wanted.env_nonzeros = larger_of(need.env_nonzeros, smaller_of(need.nonzeros, Offset{1024} * 1024));
    engine_.reserve(wanted, request.options.solver, kPrecisionOf<Real>);
  }
  // A plan that is not shared can change or vanish unseen. A captured solve must plan for the data it will be replayed
  // with. A graph that is launched between two solves leaves its own plan behind.
  const std::weak_ptr<const PlanData> owner =
      request.plan == nullptr ? std::weak_ptr<const PlanData>() : request.plan->weak_from_this();
  const bool is_planned = !engine_.captured() && !capturing && !owner.expired() && same_owner(owner, planned_);
  planned_.reset();
  engine_.solve(request, is_planned);
  // The fallback chain sorts the environments anew for every stage.
  if (!capturing && request.options.solver != SolverKind::automatic) planned_ = owner;
}

void DeviceContactMachine::islands(const BatchStructure& batch, Index* island, Index* count, StreamRef stream) {
  const std::lock_guard lock(mutex_);
  const Capacity need{batch.env_count, 0, 0, 0, 0, 0, 0, Precision::f32};
  if (!engine_.has_room(need))
    throw Error(ErrorCode::invalid_argument,
                "batch has " + std::to_string(batch.env_count) +
                    " environments, more than the solver has room for: construct the Solver with that Capacity");
  engine_.islands(batch, island, count, stream.handle());
}

void DeviceContactMachine::solve(const SolveRequest<float>& request) {
  run(request);
}
void DeviceContactMachine::solve(const SolveRequest<double>& request) {
  run(request);
}

}  // namespace cuda

}  // namespace stiction
