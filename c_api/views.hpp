#pragma once

#include "c_api/enums.hpp"
#include "stiction.h"
#include "stiction/bodies.hpp"
#include "stiction/jacobian_solver.hpp"
#include "stiction/solver.hpp"
#include "stiction/stepping.hpp"

/// Structs of C as those of C++. Arrays are passed on as they are. `name`: the argument's name in an error.
/// \throws Error(invalid_argument) for an unknown enumerator.
namespace stiction::c {

SolverOptions to_cpp(const stiction_solver_options& options);
Capacity to_cpp(const stiction_capacity& capacity);
WarmStartOptions to_cpp(const stiction_warm_start_options& options);
JacobianCapacity to_cpp(const stiction_jacobian_capacity& capacity);
TimeStepping to_cpp(const stiction_time_stepping& stepping);
BodySolverOptions to_cpp(const stiction_body_options& options);

template <class Real>
ContactBatchView<Real> to_cpp(const stiction_batch_view& batch);
template <class Real>
SolutionView<Real> to_cpp(const stiction_solution& solution);
template <class Real>
JacobianBatchView<Real> to_cpp(const stiction_jacobian_view& batch);
template <class Real>
JacobianSolutionView<Real> to_cpp(const stiction_jacobian_solution& solution);
template <class Real>
BodyBatchView<Real> to_cpp(const stiction_body_view& batch);
template <class Real>
BodySolutionView<Real> to_cpp(const stiction_body_solution& solution);

/// The way back, for a batch that a file holds.
template <class Real>
stiction_batch_view to_c(const ContactBatchView<Real>& batch);

/// Calls f with a zero of the precision's type.
template <class F>
decltype(auto) with_real(Precision precision, F&& f) {
  if (precision == Precision::f64) return f(double{});
  return f(float{});
}

template <class Real>
const Real* numbers(const void* array) {
  return static_cast<const Real*>(array);
}

}  // namespace stiction::c
