#pragma once

#include "stiction.h"

namespace stiction {
struct SolverOptions;
}

/// Every struct as its init leaves it, `size` included. Numbers come from the C++ structs, so that they stand once.
namespace stiction::c {

void set_defaults(stiction_solver_options& options);
void set_defaults(stiction_capacity& capacity);
void set_defaults(stiction_warm_start_options& options);
void set_defaults(stiction_jacobian_capacity& capacity);
void set_defaults(stiction_time_stepping& stepping);
void set_defaults(stiction_body_options& options);
void set_defaults(stiction_batch_view& batch);
void set_defaults(stiction_solution& solution);
void set_defaults(stiction_jacobian_view& batch);
void set_defaults(stiction_jacobian_solution& solution);
void set_defaults(stiction_body_view& batch);
void set_defaults(stiction_body_solution& solution);
void set_defaults(stiction_derivative_options& options);
void set_defaults(stiction_solution_numbers& numbers);
void set_defaults(stiction_sweeps& sweeps);
void set_defaults(stiction_batch_numbers& numbers);
void set_defaults(stiction_jacobian_numbers& numbers);

/// Options of C++ as C has them.
stiction_solver_options to_c(const SolverOptions& options);

}  // namespace stiction::c
