#pragma once

#include "core/facade/newton_job.hpp"
#include "core/machine/jacobian_machine.hpp"
#include "stiction/trace.hpp"

namespace stiction {

/// Assembles what Newton's method in velocities has not solved, solves it, and moves the velocities. All was checked
/// before, but for numbers.
template <class Real>
void solve_jacobian(JacobianMachine<Real>& machine, const Solver& solver, const JacobianBatchView<Real>& batch,
                    const JacobianSolutionView<Real>& solution, const JacobianStart<Real>& start, StreamRef stream) {
  const SolverOptions& options = solver.options();
  const auto assemble = [&] {
    const bool by_newton = takes_newton(options);
    const ScopedSpan span(options.tracer, by_newton ? "velocity_newton" : "assemble", nullptr, 0, batch.env_count);
    const VelocityJob<Real> newton = newton_job(batch, options, solution, start);
    return machine.assemble(batch, by_newton ? &newton : nullptr, stream);
  };
  const ContactBatchView<Real> contact = assemble();
  if (contact.env_count > 0)
    solver.solve(contact, {solution.lambda, solution.w, solution.status}, start.reactions, stream);
  machine.velocities(batch, solution, stream);
}

}  // namespace stiction
