#include "stiction/stepping.hpp"

#include <string>

#include "core/runtime/backend.hpp"
#include "core/runtime/defects.hpp"
#include "stiction/error.hpp"

namespace stiction {

namespace {

template <class Real>
Capacity checked(Capacity capacity) {
  if (capacity.envs <= 0)
    throw Error(ErrorCode::invalid_argument,
                "capacity.envs = " + std::to_string(capacity.envs) +
                    ": give the number of environments and the largest rows and cones of a batch");
  if (sizeof(Real) == sizeof(double)) capacity.precision = Precision::f64;
  return capacity;
}

}  // namespace

template <class Real>
SteppingSolver<Real>::SteppingSolver(Device device, const SolverOptions& options, const Capacity& capacity,
                                     const WarmStartOptions& warm_start)
    : solver_(device, options, checked<Real>(capacity)),
      store_(device, WarmStartCapacity{capacity.envs, capacity.cones, capacity.rows}, warm_start),
      guess_(solver_.template make_array<Real>(capacity.rows)) {}
template <class Real>
SteppingSolver<Real>::~SteppingSolver() = default;
template <class Real>
SteppingSolver<Real>::SteppingSolver(SteppingSolver&&) noexcept = default;
template <class Real>
SteppingSolver<Real>& SteppingSolver<Real>::operator=(SteppingSolver&&) noexcept = default;

template <class Real>
void SteppingSolver<Real>::solve(const ContactBatchView<Real>& batch, const std::uint64_t* cone_id, double dt,
                                 const SolutionView<Real>& solution, StreamRef stream) {
  if (batch.row_count > store_.capacity().rows)
    throw Error(ErrorCode::invalid_argument, "batch has room for " + std::to_string(batch.row_count) +
                                                 " rows, the solver was made for " +
                                                 std::to_string(store_.capacity().rows) + ": construct it with more");
  // What the solver would refuse must be refused before the store changes.
  solver_.check(batch, solution);
  store_.recall(batch, cone_id, dt, guess_.get(), stream);
  solver_.solve(batch, solution, static_cast<const Real*>(guess_.get()), stream);
  store_.remember(batch, cone_id, solution, dt, stream);
}

template <class Real>
void SteppingSolver<Real>::reset(std::span<const Offset> envs, StreamRef stream) {
  store_.reset(envs, stream);
}
template <class Real>
void SteppingSolver<Real>::reset_where(const std::uint8_t* mask, StreamRef stream) {
  store_.reset_where(mask, stream);
}
template <class Real>
void SteppingSolver<Real>::reset_all(StreamRef stream) {
  store_.reset_all(stream);
}

template class SteppingSolver<float>;
template class SteppingSolver<double>;

}  // namespace stiction
