#pragma once

#include "stiction.h"
#include "tests/fuzz/any_solver.hpp"
#include "tests/fuzz/c_form.hpp"

/// Options of the C interface: such as solvers take, and one field in some of them set to anything. Iterations and
/// threads stay few.
namespace stiction::fuzz {

inline std::size_t wild_size(Bytes& bytes, std::size_t size) {
  const std::size_t sizes[] = {size, size, size, size, 0, size - 8, size + 8, SIZE_MAX, bytes.byte()};
  return bytes.one_of(sizes);
}

inline stiction_solver_options c_solver_options(Bytes& bytes) {
  stiction_solver_options options;
  stiction_solver_options_init(&options, sizeof options);
  options.solver = static_cast<std::int32_t>(any_solver(bytes));
  options.max_iterations = bytes.below(30);
  options.threads = 1;
  options.invalid = bytes.once_in(4) ? STICTION_INVALID_REJECT : STICTION_INVALID_ISOLATE;
  options.islands = bytes.once_in(8) ? STICTION_ISLANDS_APART : STICTION_ISLANDS_TOGETHER;
  if (!bytes.once_in(8)) return options;
  std::int32_t* const fields[] = {&options.solver,  &options.law,     &options.stall_window,
                                  &options.invalid, &options.islands, &options.direct_rows};
  std::int32_t& field = *bytes.one_of(fields);
  field = wild_integer(bytes, field);
  double* const numbers[] = {&options.tolerance, &options.omega};
  if (bytes.once_in(2)) *bytes.one_of(numbers) = wild<double>(bytes);
  if (bytes.once_in(4)) options.threads = -options.threads;
  options.size = wild_size(bytes, options.size);
  return options;
}

inline stiction_body_options c_body_options(Bytes& bytes) {
  stiction_body_options options;
  stiction_body_options_init(&options, sizeof options);
  options.method = bytes.below(2);
  options.preconditioner = bytes.below(6);
  options.iterations = bytes.below(10);
  options.substeps = 1 + bytes.below(2);
  options.threads = 1;
  options.invalid = bytes.once_in(4) ? STICTION_INVALID_REJECT : STICTION_INVALID_ISOLATE;
  options.max_contacts_per_env = bytes.once_in(4) ? 1 : 0;
  if (!bytes.once_in(8)) return options;
  std::int32_t* const fields[] = {&options.law,          &options.method,  &options.max_contacts_per_env,
                                  &options.invalid,      &options.cycle,   &options.preconditioner,
                                  &options.prolongation, &options.ordering};
  std::int32_t& field = *bytes.one_of(fields);
  field = wild_integer(bytes, field);
  if (bytes.once_in(2)) options.tolerance = wild<double>(bytes);
  if (bytes.once_in(2)) options.omega = wild<double>(bytes);
  options.size = wild_size(bytes, options.size);
  return options;
}

inline stiction_time_stepping c_time_stepping(Bytes& bytes) {
  stiction_time_stepping stepping;
  stiction_time_stepping_init(&stepping, sizeof stepping);
  if (!bytes.once_in(4)) return stepping;
  double* const numbers[] = {&stepping.dt, &stepping.erp, &stepping.slop, &stepping.cfm,
                             &stepping.restitution_threshold};
  *bytes.one_of(numbers) = wild<double>(bytes);
  return stepping;
}

inline stiction_warm_start_options c_warm_start_options(Bytes& bytes) {
  stiction_warm_start_options options;
  stiction_warm_start_options_init(&options, sizeof options);
  options.threads = 1;
  if (!bytes.once_in(4)) return options;
  options.beta = wild<double>(bytes);
  options.scaling = wild_integer(bytes, options.scaling);
  return options;
}

/// A capacity with one count that does not fit.
template <class Capacity>
void spoil_capacity(Capacity& capacity, Bytes& bytes) {
  std::int64_t* const counts[] = {&capacity.envs, &capacity.rows, &capacity.cones};
  std::int64_t& count = *bytes.one_of(counts);
  count = wild_integer(bytes, count);
  if (bytes.once_in(4)) capacity.precision = wild_integer(bytes, capacity.precision);
  if (bytes.once_in(4)) capacity.env_rows = wild_integer(bytes, capacity.env_rows);
  if (bytes.once_in(4)) capacity.size = wild_size(bytes, capacity.size);
}

}  // namespace stiction::fuzz
