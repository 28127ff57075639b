#include "c_api/views.hpp"

#include <cstddef>

#include "c_api/defaults.hpp"

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

const ConeKind* kinds(const std::uint8_t* cone_kind) {
  return reinterpret_cast<const ConeKind*>(cone_kind);
}

/// What contact and Jacobian batches have in common.
template <class Cpp, class C>
void copy_common(Cpp& cpp, const C& c) {
  cpp.env_count = c.env_count;
  cpp.cone_count = c.cone_count;
  cpp.row_count = c.row_count;
  cpp.env_row_offsets = c.env_row_offsets;
  cpp.env_cone_offsets = c.env_cone_offsets;
  cpp.env_row_counts = c.env_row_counts;
  cpp.env_cone_counts = c.env_cone_counts;
  cpp.env_flags = c.env_flags;
  cpp.env_tolerance = c.env_tolerance;
  cpp.env_max_iterations = c.env_max_iterations;
  cpp.cone_row_offsets = c.cone_row_offsets;
  cpp.cone_group = c.cone_group;
  cpp.row_offsets = c.row_offsets;
  cpp.column = c.column;
}

/// Their numbers, which are Real in C++ and void in C.
template <class Real, class C>
void copy_numbers(auto& cpp, const C& c) {
  cpp.R = numbers<Real>(c.R);
  cpp.mu = numbers<Real>(c.mu);
  cpp.lo = numbers<Real>(c.lo);
  cpp.hi = numbers<Real>(c.hi);
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
  copy_common(cpp, batch);
  copy_numbers<Real>(cpp, batch);
  cpp.cone_kind = kinds(batch.cone_kind);
  cpp.nonzero_count = batch.nonzero_count;
  cpp.row_counts = batch.row_counts;
  cpp.column_offsets = batch.column_offsets;
  cpp.column_count = batch.column_count;
  cpp.A = numbers<Real>(batch.A);
  cpp.factor_offsets = batch.factor_offsets;
  cpp.factor = numbers<Real>(batch.factor);
  cpp.factor_count = batch.factor_count;
  cpp.b = numbers<Real>(batch.b);
  cpp.mu_offsets = batch.mu_offsets;
  cpp.mu_count = batch.mu_count;
  cpp.normal_last = batch.normal_last != 0;
  cpp.law = law_of("batch.law", batch.law);
  cpp.space = space_of("batch.space", batch.space);
  return cpp;
}

template <class Real>
stiction_batch_view to_c(const ContactBatchView<Real>& batch) {
  stiction_batch_view c;
  set_defaults(c);
  copy_common(c, batch);
  c.precision = sizeof(Real) == sizeof(double) ? STICTION_F64 : STICTION_F32;
  c.R = batch.R;
  c.mu = batch.mu;
  c.lo = batch.lo;
  c.hi = batch.hi;
  c.cone_kind = reinterpret_cast<const std::uint8_t*>(batch.cone_kind);
  c.nonzero_count = batch.nonzero_count;
  c.row_counts = batch.row_counts;
  c.column_offsets = batch.column_offsets;
  c.column_count = batch.column_count;
  c.A = batch.A;
  c.factor_offsets = batch.factor_offsets;
  c.factor = batch.factor;
  c.factor_count = batch.factor_count;
  c.b = batch.b;
  c.mu_offsets = batch.mu_offsets;
  c.mu_count = batch.mu_count;
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
  copy_common(cpp, batch);
  copy_numbers<Real>(cpp, batch);
  cpp.cone_kind = kinds(batch.cone_kind);
  cpp.dof_count = batch.dof_count;
  cpp.entry_count = batch.entry_count;
  cpp.mass_count = batch.mass_count;
  cpp.env_dof_offsets = batch.env_dof_offsets;
  cpp.env_mass_offsets = batch.env_mass_offsets;
  cpp.J = numbers<Real>(batch.J);
  cpp.M = numbers<Real>(batch.M);
  cpp.v_free = numbers<Real>(batch.v_free);
  cpp.target = numbers<Real>(batch.target);
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
  cpp.env_body_offsets = batch.env_body_offsets;
  cpp.env_contact_offsets = batch.env_contact_offsets;
  cpp.inv_mass = numbers<Real>(batch.inv_mass);
  cpp.inv_inertia = numbers<Real>(batch.inv_inertia);
  cpp.twist = numbers<Real>(batch.twist);
  cpp.twist_change = numbers<Real>(batch.twist_change);
  cpp.kinematic = batch.kinematic;
  cpp.body_a = batch.body_a;
  cpp.body_b = batch.body_b;
  cpp.arm_a = numbers<Real>(batch.arm_a);
  cpp.arm_b = numbers<Real>(batch.arm_b);
  cpp.normal = numbers<Real>(batch.normal);
  cpp.mu = numbers<Real>(batch.mu);
  cpp.depth = numbers<Real>(batch.depth);
  cpp.restitution = numbers<Real>(batch.restitution);
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
