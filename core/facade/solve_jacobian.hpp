#pragma once

#include "core/facade/newton_job.hpp"
#include "core/machine/jacobian_machine.hpp"
#include "stiction/trace.hpp"

namespace stiction {

/// Solves a Jacobian batch: Newton's method in velocities, then A of the other environments. All was checked before,
/// but for numbers.
template <class Real>
void solve_jacobian(JacobianMachine<Real>& machine, const Solver& solver, const JacobianBatchView<Real>& batch,
                    const JacobianSolutionView<Real>& solution, const JacobianStart<Real>& start, StreamRef stream) {
  const SolverOptions& options = solver.options();
  const auto traced = [&](const char* name, auto&& step) {
    const ScopedSpan span(options.tracer, name, nullptr, 0, batch.env_count);
    return step();
  };
  const bool all_solved = takes_newton(options) && traced("velocity_newton", [&] {
                            return machine.solve_velocities(newton_job(batch, options, solution, start), stream);
                          });
  if (!all_solved)
    machine.queue_rest(batch, stream, [&](StreamRef own) {
      const ContactBatchView<Real> rest = traced("assemble", [&] { return machine.assemble(batch, own); });
      if (rest.env_count > 0) solver.solve(rest, SolutionView<Real>(solution), start.reactions, own);
    });
  machine.write(batch, solution, stream);
}

}  // namespace stiction
