#include "cli/solve_bodies.hpp"

#include <span>

#include "cli/stopwatch.hpp"
#include "stiction/jacobian_bodies.hpp"

namespace stiction::cli {

template <class Real>
Solution<Real> solve_as_bodies(const JacobianBatch<Real>& batch, Device device, const BodySolverOptions& options,
                               const std::vector<Real>& warm_start, int repeat, Seconds& seconds, Tracer* tracer) {
  const Clock::time_point start = Clock::now();
  const JacobianBodies<Real> bodies = as_bodies(batch.view());
  const BodyBatchView<Real> view = bodies.batch.view();
  const std::vector<Real> first =
      warm_start.empty() ? std::vector<Real>{} : to_contacts(bodies, std::span<const Real>(warm_start));
  const BodySolver solver(device, bodies.stepping, options);
  const BodyPlan plan = solver.plan(view);
  seconds.plan = seconds_since(start);
  std::vector<Real> impulse(3 * static_cast<std::size_t>(view.contact_count)), w(impulse.size());
  std::vector<Real> twist(6 * static_cast<std::size_t>(view.body_count));
  Solution<Real> solution;
  solution.status.resize(static_cast<std::size_t>(view.env_count));
  const auto solve_once = [&] {
    solver.solve(plan, view, {impulse.data(), twist.data(), w.data(), solution.status.data()},
                 first.empty() ? nullptr : first.data());
  };
  seconds.take(shortest_of(repeat, solve_once, tracer));
  solution.lambda = to_rows(bodies, std::span<const Real>(impulse));
  solution.w = to_rows(bodies, std::span<const Real>(w));
  return solution;
}

template Solution<float> solve_as_bodies(const JacobianBatch<float>&, Device, const BodySolverOptions&,
                                         const std::vector<float>&, int, Seconds&, Tracer*);
template Solution<double> solve_as_bodies(const JacobianBatch<double>&, Device, const BodySolverOptions&,
                                          const std::vector<double>&, int, Seconds&, Tracer*);

}  // namespace stiction::cli
