#pragma once

#include <optional>
#include <string>

#include "stiction/bodies.hpp"

namespace stiction::cli {

/// Returns true if --solver names sequential impulses: npgs with momentum, of which si is another name, or pgs without
/// (docs/math/si.md).
bool is_sweeping(const std::string& solver);

/// Sets the method from --solver and --preconditioner: sequential impulses, or Newton's method with a
/// preconditioner, of which multigrid has a name of its own. \throws Error(invalid_argument) for other names, and for
/// a preconditioner of a method without one.
void choose_body_method(const std::string& solver, const std::optional<std::string>& preconditioner,
                        BodySolverOptions& options);

/// Sets the law of contacts from --law: coulomb, convex, or boxed (docs/math/box_friction.md). Called after
/// choose_body_method(). \throws Error(invalid_argument) for other names, Error(unsupported) for a method that does
/// not have the law.
void choose_contact_law(const std::string& law, BodySolverOptions& options);

}  // namespace stiction::cli
