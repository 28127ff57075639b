#include "c_api/views.hpp"

#include <concepts>
#include <cstddef>

#include "c_api/defaults.hpp"
#include "stiction/batch_arrays.hpp"

namespace stiction::c {

static_assert(sizeof(stiction_status) == sizeof(EnvStatus) &&
              offsetof(stiction_status, residual_absolute) == offsetof(EnvStatus, residual_absolute) &&
              offsetof(stiction_status, flags) == offsetof(EnvStatus, flags) &&
              offsetof(stiction_status, iterations) == offsetof(EnvStatus, iterations) &&
              offsetof(stiction_status, code) == offsetof(EnvStatus, code) &&
              offsetof(stiction_status, solver) == offsetof(EnvStatus, solver));
static_assert(sizeof(ConeKind) == sizeof(std::uint8_t));

namespace {

EnvStatus* records(stiction_status* status) {
  return reinterpret_cast<EnvStatus*>(status);
}

/// An array of a struct of C as one of C++: numbers and kinds of cones have no type of their own there.
struct FromC {
  template <class T>
  void operator()(const BatchArray&, const T*& cpp, const T* c) const {
    cpp = c;
  }
  template <std::floating_point Real>
  void operator()(const BatchArray&, const Real*& cpp, const void* c) const {
    cpp = static_cast<const Real*>(c);
  }
  void operator()(const BatchArray&, const ConeKind*& cpp, const std::uint8_t* c) const {
    cpp = reinterpret_cast<const ConeKind*>(c);
  }
};
/// The way back.
struct ToC {
  template <class T>
  void operator()(const BatchArray&, const T* cpp, const T*& c) const {
    c = cpp;
  }
  template <std::floating_point Real>
  void operator()(const BatchArray&, const Real* cpp, const void*& c) const {
    c = cpp;
  }
  void operator()(const BatchArray&, const ConeKind* cpp, const std::uint8_t*& c) const {
    c = reinterpret_cast<const std::uint8_t*>(cpp);
  }
};

/// Copies counts by name: the same in C and C++, both ways.
template <class To, class From>
void copy_counts(To& to, const From& from) {
  to.env_count = from.env_count;
  to.cone_count = from.cone_count;
  to.row_count = from.row_count;
}
template <class To, class From>
void copy_matrix_counts(To& to, const From& from) {
  copy_counts(to, from);
  to.nonzero_count = from.nonzero_count;
  to.column_count = from.column_count;
  to.factor_count = from.factor_count;
  to.mu_count = from.mu_count;
}

}  // namespace

SolverOptions to_cpp(const stiction_solver_options& options) {
  SolverOptions cpp;
  cpp.solver = solver_of("options.solver", options.solver);
  cpp.law = law_or_batch("options.law", options.law);
  cpp.tolerance = options.tolerance;
  cpp.max_iterations = options.max_iterations;
  cpp.stall_window = options.stall_window;
  cpp.omega = options.omega;
  cpp.threads = options.threads;
  cpp.invalid = invalid_of("options.invalid", options.invalid);
  cpp.islands = islands_of("options.islands", options.islands);
  cpp.direct_rows = options.direct_rows;
  cpp.absolute_tolerance = options.absolute_tolerance;
  cpp.choose = choice_of("options.choose", options.choose);
  need_zero("options.reserved", options.reserved);
  return cpp;
}

Capacity to_cpp(const stiction_capacity& capacity) {
  Capacity cpp;
  cpp.envs = capacity.envs;
  cpp.rows = capacity.rows;
  cpp.cones = capacity.cones;
  cpp.nonzeros = capacity.nonzeros;
  cpp.env_rows = capacity.env_rows;
  cpp.env_nonzeros = capacity.env_nonzeros;
  cpp.env_dofs = capacity.env_dofs;
  cpp.precision = precision_of("capacity.precision", capacity.precision);
  cpp.semidefinite = yes_or_no("capacity.semidefinite", capacity.semidefinite);
  return cpp;
}

WarmStartOptions to_cpp(const stiction_warm_start_options& options) {
  WarmStartOptions cpp;
  cpp.beta = options.beta;
  cpp.scaling = step_scaling_of("warm_start.scaling", options.scaling);
  cpp.threads = options.threads;
  return cpp;
}

JacobianCapacity to_cpp(const stiction_jacobian_capacity& capacity) {
  JacobianCapacity cpp;
  cpp.envs = capacity.envs;
  cpp.rows = capacity.rows;
  cpp.cones = capacity.cones;
  cpp.env_rows = capacity.env_rows;
  cpp.env_dofs = capacity.env_dofs;
  cpp.matrix = capacity.matrix;
  cpp.factor = capacity.factor;
  cpp.semidefinite = yes_or_no("capacity.semidefinite", capacity.semidefinite);
  return cpp;
}

TimeStepping to_cpp(const stiction_time_stepping& stepping) {
  TimeStepping cpp;
  cpp.dt = stepping.dt;
  cpp.erp = stepping.erp;
  cpp.slop = stepping.slop;
  cpp.cfm = stepping.cfm;
  cpp.restitution_threshold = stepping.restitution_threshold;
  return cpp;
}

BodySolverOptions to_cpp(const stiction_body_options& options) {
  BodySolverOptions cpp;
  cpp.box_friction = options.law == STICTION_LAW_BOXED;
  if (!cpp.box_friction) cpp.law = law_of("options.law", options.law);
  cpp.method = body_method_of("options.method", options.method);
  cpp.space.preconditioner = preconditioner_of("options.preconditioner", options.preconditioner);
  cpp.space.multigrid.prolongation = prolongation_of("options.prolongation", options.prolongation);
  cpp.space.multigrid.cycle = cycle_of("options.cycle", options.cycle);
  cpp.space.ordering = ordering_of("options.ordering", options.ordering);
  cpp.iterations = options.iterations;
  cpp.tolerance = options.tolerance;
  cpp.absolute_tolerance = options.absolute_tolerance;
  cpp.momentum = options.momentum != 0;
  cpp.omega = options.omega;
  cpp.substeps = options.substeps;
  cpp.max_contacts_per_env = options.max_contacts_per_env;
  cpp.threads = options.threads;
  cpp.invalid = invalid_of("options.invalid", options.invalid);
  return cpp;
}

template <class Real>
ContactBatchView<Real> to_cpp(const stiction_batch_view& batch) {
  ContactBatchView<Real> cpp;
  copy_matrix_counts(cpp, batch);
  for_each_array(cpp, FromC{}, cpp, batch);
  cpp.normal_last = batch.normal_last != 0;
  cpp.law = law_of("batch.law", batch.law);
  cpp.space = space_of("batch.space", batch.space);
  return cpp;
}

template <class Real>
stiction_batch_view to_c(const ContactBatchView<Real>& batch) {
  stiction_batch_view c;
  set_defaults(c);
  copy_matrix_counts(c, batch);
  for_each_array(batch, ToC{}, batch, c);
  c.precision = sizeof(Real) == sizeof(double) ? STICTION_F64 : STICTION_F32;
  c.normal_last = batch.normal_last ? 1 : 0;
  c.law = static_cast<std::int32_t>(batch.law);
  c.space = static_cast<std::int32_t>(batch.space);
  return c;
}

template <class Real>
SolutionView<Real> to_cpp(const stiction_solution& solution) {
  return {static_cast<Real*>(solution.lambda), static_cast<Real*>(solution.w), records(solution.status)};
}

template <class Real>
JacobianBatchView<Real> to_cpp(const stiction_jacobian_view& batch) {
  need_zero("batch.reserved", batch.reserved);
  JacobianBatchView<Real> cpp;
  copy_counts(cpp, batch);
  cpp.dof_count = batch.dof_count;
  cpp.entry_count = batch.entry_count;
  cpp.mass_count = batch.mass_count;
  for_each_array(cpp, FromC{}, cpp, batch);
  cpp.mass_form = mass_form_of("batch.mass_form", batch.mass_form);
  cpp.mass_block = batch.mass_block;
  cpp.law = law_of("batch.law", batch.law);
  cpp.space = space_of("batch.space", batch.space);
  return cpp;
}

template <class Real>
JacobianSolutionView<Real> to_cpp(const stiction_jacobian_solution& solution) {
  return {static_cast<Real*>(solution.lambda), static_cast<Real*>(solution.w), static_cast<Real*>(solution.velocity),
          records(solution.status)};
}

template <class Real>
BodyBatchView<Real> to_cpp(const stiction_body_view& batch) {
  BodyBatchView<Real> cpp;
  cpp.env_count = batch.env_count;
  cpp.body_count = batch.body_count;
  cpp.contact_count = batch.contact_count;
  for_each_array(cpp, FromC{}, cpp, batch);
  cpp.space = space_of("batch.space", batch.space);
  return cpp;
}

template <class Real>
BodySolutionView<Real> to_cpp(const stiction_body_solution& solution) {
  return {static_cast<Real*>(solution.impulse), static_cast<Real*>(solution.twist), static_cast<Real*>(solution.w),
          records(solution.status)};
}

template ContactBatchView<float> to_cpp(const stiction_batch_view&);
template ContactBatchView<double> to_cpp(const stiction_batch_view&);
template stiction_batch_view to_c(const ContactBatchView<float>&);
template stiction_batch_view to_c(const ContactBatchView<double>&);
template SolutionView<float> to_cpp(const stiction_solution&);
template SolutionView<double> to_cpp(const stiction_solution&);
template JacobianBatchView<float> to_cpp(const stiction_jacobian_view&);
template JacobianBatchView<double> to_cpp(const stiction_jacobian_view&);
template JacobianSolutionView<float> to_cpp(const stiction_jacobian_solution&);
template JacobianSolutionView<double> to_cpp(const stiction_jacobian_solution&);
template BodyBatchView<float> to_cpp(const stiction_body_view&);
template BodyBatchView<double> to_cpp(const stiction_body_view&);
template BodySolutionView<float> to_cpp(const stiction_body_solution&);
template BodySolutionView<double> to_cpp(const stiction_body_solution&);

}  // namespace stiction::c
