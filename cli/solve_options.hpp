#pragma once

#include "cli/commands.hpp"
#include "stiction/bodies.hpp"
#include "stiction/recorder.hpp"
#include "stiction/solver.hpp"

namespace stiction::cli {

/// Returns true if J and M of the file are read: they are solved, or the bodies that they are of.
bool takes_jacobian(const SolveArguments& arguments);
bool is_bodies(const SolveArguments& arguments);

SolverOptions solver_options(const SolveArguments& arguments);
/// Returns the options of a solver of bodies; the law is that of the batch.
BodySolverOptions body_options(const SolveArguments& arguments, const SolverOptions& common, Law law);
/// When a batch is recorded, of --record-when.
io::RecordWhen record_when(const std::string& text);

/// Refuses invalid options before the file is read, let alone solved. \throws Error(invalid_argument)
void check_solve_arguments(const SolveArguments& arguments);

}  // namespace stiction::cli
