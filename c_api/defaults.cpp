#include "c_api/defaults.hpp"

#include <cstdint>
#include <string>

#include "c_api/structs.hpp"
#include "stiction/bodies.hpp"
#include "stiction/jacobian_solver.hpp"
#include "stiction/preset.hpp"
#include "stiction/solver.hpp"
#include "stiction/warm_start.hpp"

namespace stiction::c {

namespace {

/// A struct of null pointers and zeros.
template <class Struct>
void clear(Struct& all) {
  all = Struct{};
  all.size = sizeof(Struct);
}

template <class E>
std::int32_t number(E enumerator) {
  return static_cast<std::int32_t>(enumerator);
}

}  // namespace

void check_size(const char* argument, std::size_t size, std::size_t whole, std::size_t step) {
  if (size > whole)
    refuse(std::string(argument) + ".size = " + std::to_string(size) + ", but this library, version " +
           stiction_version() + ", knows " + std::to_string(whole) +
           " bytes of that struct: the program was compiled for a later version; install that, or compile it again");
  if (size < sizeof(std::size_t) || size % step != 0)
    refuse(std::string(argument) + ".size = " + std::to_string(size) +
           ": no version of that struct has this size; set it up with its init function, which is given sizeof");
}

stiction_solver_options to_c(const SolverOptions& options) {
  stiction_solver_options c;
  clear(c);
  c.tolerance = options.tolerance;
  c.omega = options.omega;
  c.solver = number(options.solver);
  c.law = options.law.has_value() ? number(*options.law) : STICTION_LAW_OF_BATCH;
  c.max_iterations = options.max_iterations;
  c.stall_window = options.stall_window;
  c.threads = options.threads;
  c.invalid = number(options.invalid);
  c.islands = number(options.islands);
  c.direct_rows = options.direct_rows;
  c.choose = number(options.choose);
  c.absolute_tolerance = options.absolute_tolerance;
  return c;
}

void set_defaults(stiction_solver_options& options) {
  options = to_c(SolverOptions{});
}

void set_defaults(stiction_capacity& capacity) {
  clear(capacity);
  capacity.precision = number(Capacity{}.precision);
}

void set_defaults(stiction_warm_start_options& options) {
  clear(options);
  const WarmStartOptions cpp;
  options.beta = cpp.beta;
  options.scaling = number(cpp.scaling);
  options.threads = cpp.threads;
}

void set_defaults(stiction_jacobian_capacity& capacity) {
  clear(capacity);
  capacity.precision = STICTION_F32;
  capacity.factor_use = STICTION_FACTOR_BY_SIZE;
}

void set_defaults(stiction_time_stepping& stepping) {
  clear(stepping);
  const TimeStepping cpp;
  stepping.dt = cpp.dt;
  stepping.erp = cpp.erp;
  stepping.slop = cpp.slop;
  stepping.cfm = cpp.cfm;
  stepping.restitution_threshold = cpp.restitution_threshold;
}

void set_defaults(stiction_body_options& options) {
  clear(options);
  const BodySolverOptions cpp;
  options.tolerance = cpp.tolerance;
  options.omega = cpp.omega;
  options.law = number(cpp.law);
  options.method = number(cpp.method);
  options.iterations = cpp.iterations;
  options.momentum = cpp.momentum ? 1 : 0;
  options.substeps = cpp.substeps;
  options.max_contacts_per_env = cpp.max_contacts_per_env;
  options.threads = cpp.threads;
  options.invalid = number(cpp.invalid);
  options.preconditioner = number(cpp.space.preconditioner);
  options.prolongation = number(cpp.space.multigrid.prolongation);
  options.cycle = number(cpp.space.multigrid.cycle);
  options.ordering = number(cpp.space.ordering);
  options.absolute_tolerance = cpp.absolute_tolerance;
}

void set_defaults(stiction_batch_view& batch) {
  clear(batch);
}
void set_defaults(stiction_solution& solution) {
  clear(solution);
}
void set_defaults(stiction_jacobian_view& batch) {
  clear(batch);
}
void set_defaults(stiction_jacobian_solution& solution) {
  clear(solution);
}
void set_defaults(stiction_body_view& batch) {
  clear(batch);
}
void set_defaults(stiction_body_solution& solution) {
  clear(solution);
}

}  // namespace stiction::c

using stiction::c::init_struct;

stiction_code stiction_solver_options_init(stiction_solver_options* options, size_t size) {
  return init_struct(options, size, "options");
}
stiction_code stiction_capacity_init(stiction_capacity* capacity, size_t size) {
  return init_struct(capacity, size, "capacity");
}
stiction_code stiction_batch_view_init(stiction_batch_view* batch, size_t size) {
  return init_struct(batch, size, "batch");
}
stiction_code stiction_solution_init(stiction_solution* solution, size_t size) {
  return init_struct(solution, size, "solution");
}
stiction_code stiction_jacobian_capacity_init(stiction_jacobian_capacity* capacity, size_t size) {
  return init_struct(capacity, size, "capacity");
}
stiction_code stiction_jacobian_view_init(stiction_jacobian_view* batch, size_t size) {
  return init_struct(batch, size, "batch");
}
stiction_code stiction_jacobian_solution_init(stiction_jacobian_solution* solution, size_t size) {
  return init_struct(solution, size, "solution");
}
stiction_code stiction_time_stepping_init(stiction_time_stepping* stepping, size_t size) {
  return init_struct(stepping, size, "stepping");
}
stiction_code stiction_body_options_init(stiction_body_options* options, size_t size) {
  return init_struct(options, size, "options");
}
stiction_code stiction_body_view_init(stiction_body_view* batch, size_t size) {
  return init_struct(batch, size, "batch");
}
stiction_code stiction_body_solution_init(stiction_body_solution* solution, size_t size) {
  return init_struct(solution, size, "solution");
}
stiction_code stiction_warm_start_options_init(stiction_warm_start_options* options, size_t size) {
  return init_struct(options, size, "options");
}

stiction_code stiction_solver_options_preset(stiction_solver_options* options, const char* preset) {
  return stiction::c::guarded([&] {
    stiction::c::need(preset, "preset", "give its name, for example \"locomotion\"");
    const stiction_solver_options before = stiction::c::read_struct(options, "options");
    stiction_solver_options full = stiction::c::to_c(stiction::options_for(stiction::preset_from_string(preset)));
    full.threads = before.threads;
    full.law = before.law;
    full.invalid = before.invalid;
    full.islands = before.islands;
    stiction::c::write_struct(options, full, options->size);
  });
}
