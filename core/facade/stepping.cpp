#include "stiction/stepping.hpp"

#include <limits>
#include <string>

#include "core/base/fp_env.hpp"
#include "core/runtime/check/expect.hpp"

namespace stiction {

namespace {

void check_envs(Offset envs) {
  if (envs <= 0)
    refuse("capacity.envs = " + std::to_string(envs) +
           ": give the number of environments and the largest rows and cones of a batch");
}

template <class Real>
Capacity checked(Capacity capacity) {
  check_envs(capacity.envs);
  if (sizeof(Real) == sizeof(double)) capacity.precision = Precision::f64;
  return capacity;
}

JacobianCapacity checked(const JacobianCapacity& capacity) {
  check_envs(capacity.envs);
  return capacity;
}

/// Every contact is a cone of three rows.
WarmStartCapacity contact_room(Offset envs, Offset contacts) {
  check_envs(envs);
  constexpr Offset kMost = std::numeric_limits<Offset>::max() / 3;
  if (contacts < 0 || contacts > kMost)
    refuse("contacts = " + std::to_string(contacts) + ": expected 0.." + std::to_string(kMost) +
           ", the contacts of all environments together");
  return {envs, contacts, 3 * contacts};
}

}  // namespace

template <class Real>
void StepMemory<Real>::reset(std::span<const Offset> envs, StreamRef stream) {
  store_.reset(envs, stream);
}
template <class Real>
void StepMemory<Real>::reset_where(const std::uint8_t* mask, StreamRef stream) {
  store_.reset_where(mask, stream);
}
template <class Real>
void StepMemory<Real>::reset_all(StreamRef stream) {
  store_.reset_all(stream);
}

template <class Real>
void StepMemory<Real>::check_rows(Offset row_count) const {
  if (row_count > store_.capacity().rows)
    refuse("batch has room for " + std::to_string(row_count) + " rows, the solver was made for " +
           std::to_string(store_.capacity().rows) + ": construct it with more");
}

template <class Real>
SteppingSolver<Real>::SteppingSolver(Device device, const SolverOptions& options, const Capacity& capacity,
                                     const WarmStartOptions& warm_start)
    : StepMemory<Real>(device, {checked<Real>(capacity).envs, capacity.cones, capacity.rows}, warm_start),
      solver_(device, options, checked<Real>(capacity)) {
  this->guess_ = solver_.template make_array<Real>(capacity.rows);
}

template <class Real>
void SteppingSolver<Real>::solve(const ContactBatchView<Real>& batch, const std::uint64_t* cone_id, double dt,
                                 const SolutionView<Real>& solution, StreamRef stream) {
  const ScopedFpEnv fp_env;
  this->check_rows(batch.row_count);
  // Batches that the solver would refuse must be refused before the store changes.
  solver_.check(batch, solution);
  this->step(batch, cone_id, dt, solution, stream,
             [&](const Real* guess) { solver_.solve(batch, solution, guess, stream); });
}

template <class Real>
JacobianSteppingSolver<Real>::JacobianSteppingSolver(Device device, const SolverOptions& options,
                                                     const JacobianCapacity& capacity,
                                                     const WarmStartOptions& warm_start, FactorUse use)
    : StepMemory<Real>(device, {checked(capacity).envs, capacity.cones, capacity.rows}, warm_start),
      solver_(device, options, capacity, use) {
  this->guess_ = solver_.solver().template make_array<Real>(capacity.rows);
}

template <class Real>
void JacobianSteppingSolver<Real>::solve(const JacobianBatchView<Real>& batch, const std::uint64_t* cone_id, double dt,
                                         const JacobianSolutionView<Real>& solution, StreamRef stream) {
  const ScopedFpEnv fp_env;
  this->check_rows(batch.row_count);
  solver_.check(batch, solution);
  this->step(batch, cone_id, dt, solution, stream,
             [&](const Real* guess) { solver_.solve(batch, solution, guess, stream); });
}

template <class Real>
BodySteppingSolver<Real>::BodySteppingSolver(Device device, const TimeStepping& stepping,
                                             const BodySolverOptions& options, Offset envs, Offset contacts,
                                             const WarmStartOptions& warm_start)
    : StepMemory<Real>(device, contact_room(envs, contacts), warm_start),
      solver_(device, stepping, options),
      memory_(device, {}) {
  this->guess_ = memory_.template make_array<Real>(3 * contacts);
}

template <class Real>
void BodySteppingSolver<Real>::solve(const BodyBatchView<Real>& batch, const BodySolutionView<Real>& solution,
                                     StreamRef stream) {
  solve(solver_.plan(batch, stream), batch, solution, stream);
}

template <class Real>
void BodySteppingSolver<Real>::solve(const BodyPlan& plan, const BodyBatchView<Real>& batch,
                                     const BodySolutionView<Real>& solution, StreamRef stream) {
  const ScopedFpEnv fp_env;
  this->check_rows(3 * batch.contact_count);
  solver_.check(plan, batch, solution);
  this->step(batch, batch.contact_id, solver_.stepping().dt, solution, stream,
             [&](const Real* guess) { solver_.solve(plan, batch, solution, guess, stream); });
}

template <class Real>
void BodySteppingSolver<Real>::change(const TimeStepping& stepping, const BodySolverOptions& options) {
  solver_ = BodySolver(solver_.device(), stepping, options);
}

template class StepMemory<float>;
template class StepMemory<double>;
template class SteppingSolver<float>;
template class SteppingSolver<double>;
template class JacobianSteppingSolver<float>;
template class JacobianSteppingSolver<double>;
template class BodySteppingSolver<float>;
template class BodySteppingSolver<double>;

}  // namespace stiction
