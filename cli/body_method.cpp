#include "cli/body_method.hpp"

#include <fmt/format.h>

#include "stiction/error.hpp"

namespace stiction::cli {

bool is_sweeping(const std::string& solver) {
  return solver == "si" || solver == "npgs" || solver == "pgs";
}

void choose_body_method(const std::string& solver, const std::optional<std::string>& preconditioner,
                        BodySolverOptions& options) {
  const bool is_newton = solver == "newton", is_multigrid = solver == "multigrid";
  if (!is_newton && !is_multigrid && !is_sweeping(solver))
    throw Error(ErrorCode::invalid_argument,
                fmt::format("--solver {}: expected si, npgs, pgs, newton or multigrid", solver));
  if (preconditioner && !is_newton)
    throw Error(ErrorCode::invalid_argument,
                fmt::format("--preconditioner {}: it is newton's, and the solver is {}: choose --solver newton",
                            *preconditioner, solver));
  options.method = is_newton || is_multigrid ? BodyMethod::newton : BodyMethod::impulses;
  options.momentum = solver != "pgs";
  options.space.preconditioner = is_multigrid ? BodyPreconditioner::multigrid : BodyPreconditioner::block_diagonal;
  if (preconditioner) options.space.preconditioner = body_preconditioner_from_string(*preconditioner);
}

void choose_contact_law(const std::string& law, BodySolverOptions& options) {
  if (law != "coulomb" && law != "convex" && law != "boxed")
    throw Error(ErrorCode::invalid_argument, fmt::format("--law {}: expected coulomb, convex or boxed", law));
  options.law = law == "convex" ? Law::convex : Law::coulomb;
  options.box_friction = law == "boxed";
  if (options.box_friction && options.method != BodyMethod::impulses)
    throw Error(ErrorCode::unsupported,
                "--law boxed: Newton's method and multigrid have no boxed friction: choose --solver si");
}

}  // namespace stiction::cli
