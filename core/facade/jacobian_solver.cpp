#include "stiction/jacobian_solver.hpp"

#include <algorithm>
#include <exception>
#include <string>

#include "core/base/extents.hpp"
#include "core/base/fp_env.hpp"
#include "core/facade/jacobian_arrays.hpp"
#include "core/facade/overlap.hpp"
#include "core/facade/solve_jacobian.hpp"
#include "core/machine/jacobian_machine.hpp"
#include "core/runtime/check/expect.hpp"

namespace stiction {

namespace {

void check_room(const char* what, Offset room) {
  if (room < 0) refuse("capacity." + std::string(what) + " = " + std::to_string(room) + ": must be >= 0");
}

JacobianCapacity checked(const JacobianCapacity& capacity) {
  check_room("envs", capacity.envs);
  check_room("rows", capacity.rows);
  check_room("cones", capacity.cones);
  check_room("env_rows", capacity.env_rows);
  check_room("env_dofs", capacity.env_dofs);
  check_room("matrix", capacity.matrix);
  check_room("factor", capacity.factor);
  return capacity;
}

/// The first of 1 to `most` for which `holds`, which then holds for all after it, or most + 1. By bisection: a capacity
/// may be billions.
template <class Predicate>
Offset first_that(Offset most, Predicate holds) {
  Offset first = 1;
  for (Offset end = most + 1; first < end;) {
    const Offset middle = first + (end - first) / 2;
    if (holds(middle))
      end = middle;
    else
      first = middle + 1;
  }
  return first;
}

/// Most rows of an environment that keeps its matrix. With more rows than those, each is kept as a factor.
Offset matrix_rows(Index env_rows, Index env_dofs, FactorUse use) {
  return first_that(env_rows, [&](Offset rows) { return keeps_factor(use, rows, env_dofs); }) - 1;
}

/// Most columns of a factor. With more columns than those, each is kept as a matrix.
Index factor_dofs(Index env_rows, Index env_dofs, FactorUse use) {
  return static_cast<Index>(first_that(env_dofs, [&](Offset dofs) { return !keeps_factor(use, env_rows, dofs); }) - 1);
}

template <class Real>
Capacity room_of(const JacobianCapacity& capacity, FactorUse use) {
  const Offset rows = matrix_rows(capacity.env_rows, capacity.env_dofs, use);
  return {capacity.envs,
          capacity.rows,
          capacity.cones,
          capacity.matrix,
          capacity.env_rows,
          rows * rows,
          factor_dofs(capacity.env_rows, capacity.env_dofs, use),
          sizeof(Real) == sizeof(float) ? Precision::f32 : Precision::f64,
          capacity.semidefinite};
}

template <class Real>
std::unique_ptr<JacobianMachine<Real>> make_machine(Device device, const JacobianCapacity& capacity, FactorUse use,
                                                    const SolverOptions& options) {
  const bool by_newton = takes_newton(options);
  if (device.kind == DeviceKind::cuda)
    return make_cuda_jacobian_machine<Real>(device.ordinal, capacity, use, by_newton);
  if (device.kind == DeviceKind::emulated) return make_emulated_jacobian_machine<Real>(capacity, use, by_newton);
  return make_cpu_jacobian_machine<Real>(use, options.threads);
}

void check_count(const char* name, Offset count, Offset room) {
  if (count < 0) refuse("batch." + std::string(name) + " = " + std::to_string(count) + ": counts must be >= 0");
  if (count > room)
    refuse("batch." + std::string(name) + " = " + std::to_string(count) + ", the solver has room for " +
           std::to_string(room) + ": construct it with the JacobianCapacity of the largest batch");
}

/// Checks a batch whose arrays are out of sight.
template <class Real>
void check_view(const JacobianBatchView<Real>& batch, const JacobianCapacity& capacity) {
  check_count("env_count", batch.env_count, capacity.envs);
  check_count("row_count", batch.row_count, capacity.rows);
  check_count("cone_count", batch.cone_count, capacity.cones);
  check_arrays(batch);
}

}  // namespace

template <class Real>
JacobianCapacity JacobianCapacity::of(const JacobianBatchView<Real>& batch, FactorUse use) {
  check_structure(batch);
  JacobianCapacity need;
  need.envs = batch.env_count;
  need.rows = batch.row_count;
  need.cones = batch.cone_count;
  for (Offset env = 0; env < batch.env_count; ++env) {
    const Index rows = batch.env_rows(env), dofs = batch.env_dofs(env);
    need.env_rows = larger_of(need.env_rows, rows);
    need.env_dofs = larger_of(need.env_dofs, dofs);
    const bool as_factor = keeps_factor(use, rows, dofs);
    (as_factor ? need.factor : need.matrix) += Offset{rows} * (as_factor ? dofs : rows);
    const ConeKind* const kinds = batch.cone_kind + batch.env_cone_offsets[env];
    const ConeKind* const end = kinds + batch.env_cones(env);
    need.semidefinite = need.semidefinite || std::find(kinds, end, ConeKind::semidefinite) != end;
  }
  return need;
}

JacobianCapacity JacobianCapacity::of_largest(Offset envs, Index env_rows, Index env_cones, Index env_dofs,
                                              FactorUse use) {
  JacobianCapacity need;
  need.envs = envs;
  need.rows = envs * env_rows;
  need.cones = envs * env_cones;
  need.env_rows = env_rows;
  need.env_dofs = env_dofs;
  const Offset rows = matrix_rows(env_rows, env_dofs, use);
  need.matrix = envs * rows * rows;
  need.factor = envs * env_rows * factor_dofs(env_rows, env_dofs, use);
  return checked(need);
}

template <class Real>
JacobianSolver<Real>::JacobianSolver(Device device, const SolverOptions& options, const JacobianCapacity& capacity,
                                     FactorUse use)
    : capacity_(checked(capacity)),
      solver_(device, options, room_of<Real>(capacity, use)),
      machine_(make_machine<Real>(device, capacity, use, options)) {}
template <class Real>
JacobianSolver<Real>::~JacobianSolver() = default;
template <class Real>
JacobianSolver<Real>::JacobianSolver(JacobianSolver&&) noexcept = default;
template <class Real>
JacobianSolver<Real>& JacobianSolver<Real>::operator=(JacobianSolver&&) noexcept = default;

template <class Real>
void JacobianSolver<Real>::check(const JacobianBatchView<Real>& batch, const JacobianSolutionView<Real>& solution,
                                 const JacobianStart<Real>& start) const {
  const ScopedFpEnv fp_env;
  const bool on_host = solver_.device().kind == DeviceKind::cpu;
  if (batch.space != (on_host ? MemorySpace::host : MemorySpace::cuda))
    refuse("batch.space is not the solver's: a JacobianSolver on the CPU reads host memory, one on a device its own");
  if (on_host)
    check_structure(batch);
  else
    check_view(batch, capacity_);
  check_array("solution.lambda", solution.lambda, batch.row_count);
  check_array("solution.status", solution.status, batch.env_count);
  refuse_overlaps(batch, solution, start);
}

template <class Real>
void JacobianSolver<Real>::solve(const JacobianBatchView<Real>& batch, const JacobianSolutionView<Real>& solution,
                                 const JacobianStart<Real>& start, StreamRef stream) {
  const ScopedFpEnv fp_env;
  check(batch, solution, start);
  if (batch.env_count == 0) return;
  solve_jacobian(*machine_, solver_, batch, solution, start, stream);
}

template JacobianCapacity JacobianCapacity::of(const JacobianBatchView<float>&, FactorUse);
template JacobianCapacity JacobianCapacity::of(const JacobianBatchView<double>&, FactorUse);
template class JacobianSolver<float>;
template class JacobianSolver<double>;

}  // namespace stiction
