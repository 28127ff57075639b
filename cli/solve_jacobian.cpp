#include "cli/solve_jacobian.hpp"

#include "cli/stopwatch.hpp"
#include "stiction/jacobian_solver.hpp"

namespace stiction::cli {

template <class Real>
Solution<Real> solve_jacobians(const JacobianBatch<Real>& batch, Device device, const SolverOptions& options,
                               const std::vector<Real>& warm_start, int repeat, Seconds& seconds) {
  const JacobianBatchView<Real> view = batch.view();
  Solution<Real> solution;
  if (device.kind != DeviceKind::cpu) {  // a solver there reads the device's memory; this call takes the host's
    seconds.take(shortest_of(
        repeat, [&] { solution = solve(view, options, device, std::span<const Real>(warm_start)).contact; }));
    return solution;
  }
  const Clock::time_point start = Clock::now();
  JacobianSolver<Real> solver(device, options, JacobianCapacity::of(view));
  seconds.plan = seconds_since(start);
  solution.lambda.resize(static_cast<std::size_t>(batch.row_count()));
  solution.w.resize(solution.lambda.size());
  solution.status.resize(static_cast<std::size_t>(batch.env_count()));
  const auto solve_once = [&] {
    solver.solve(view, {solution.lambda.data(), solution.w.data(), nullptr, solution.status.data()},
                 warm_start.empty() ? nullptr : warm_start.data());
  };
  seconds.take(shortest_of(repeat, solve_once, options.tracer));
  return solution;
}

template Solution<float> solve_jacobians(const JacobianBatch<float>&, Device, const SolverOptions&,
                                         const std::vector<float>&, int, Seconds&);
template Solution<double> solve_jacobians(const JacobianBatch<double>&, Device, const SolverOptions&,
                                          const std::vector<double>&, int, Seconds&);

}  // namespace stiction::cli
