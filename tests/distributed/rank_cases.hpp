#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <string>
#include <vector>

#include "scenes/body_scenes.hpp"
#include "scenes/box_scenes.hpp"
#include "stiction/bodies.hpp"
#include "stiction/residual.hpp"
#include "tests/support/bits.hpp"

/// Scenes that ranks solve, and one process beside them.
namespace stiction::distributed {

template <class Real>
BodySolution<Real> room_for(const BodyBatchView<Real>& view) {
  BodySolution<Real> solution;
  // Numbers that are not written stay, and show.
  const auto unset = static_cast<Real>(777);
  solution.impulse.assign(static_cast<std::size_t>(3 * view.contact_count), unset);
  solution.w = solution.impulse;
  solution.twist.assign(static_cast<std::size_t>(6 * view.body_count), unset);
  solution.status.resize(static_cast<std::size_t>(view.env_count));
  return solution;
}

template <class Real>
BodySolutionView<Real> view_of(BodySolution<Real>& solution) {
  return {solution.impulse.data(), solution.twist.data(), solution.w.data(), solution.status.data()};
}

struct Case {
  TimeStepping stepping;
  BodySolverOptions options;
};

template <class Real>
BodySolution<Real> by_one_process(const BodyBatch<Real>& batch, const Case& how, const std::vector<Real>& start = {}) {
  BodySolution<Real> solution = room_for(batch.view());
  const BodySolver solver(Device::cpu(), how.stepping, how.options);
  solver.solve(batch.view(), view_of(solution), start.empty() ? nullptr : start.data());
  return solution;
}

template <class Real>
void expect_same(const BodySolution<Real>& a, const BodySolution<Real>& b) {
  using Numbers = std::span<const Real>;
  EXPECT_TRUE(test::same_bits(Numbers(b.impulse), Numbers(a.impulse)));
  EXPECT_TRUE(test::same_bits(Numbers(b.twist), Numbers(a.twist)));
  EXPECT_TRUE(test::same_bits(Numbers(b.w), Numbers(a.w)));
  EXPECT_TRUE(test::same_bits(std::span<const EnvStatus>(b.status), std::span<const EnvStatus>(a.status)));
}

inline BodyBatch<double> batch_of(const BodyEnvironment<double>& environment) {
  BodyBatch<double> batch;
  batch.add(environment);
  return batch;
}
inline BodyBatch<float> single_of(const BodyEnvironment<double>& environment) {
  BodyBatch<float> batch;
  batch.add(scenes::rounded(environment));
  return batch;
}

/// A wall that is hit from the side, so that no half of it is at rest.
inline BodyEnvironment<double> wall() {
  BodyEnvironment<double> env = scenes::box_bodies(scenes::box_wall(6, 7), 0.5);
  env.bodies[3].twist = {0.7, 0.3, 0, 0, 1, 0};
  return env;
}

/// A smaller one.
inline BodyEnvironment<double> small_wall() {
  BodyEnvironment<double> env = scenes::box_bodies(scenes::box_wall(4, 5), 0.5);
  env.bodies[3].twist = {0.7, 0.3, 0, 0, 1, 0};
  return env;
}

/// No body, a wall, three bodies without contact of which one flies, and a stack whose floor is kinematic and moves.
inline BodyBatch<double> mixed_environments() {
  BodyBatch<double> batch;
  batch.add({});
  batch.add(wall());
  BodyEnvironment<double> flight;
  flight.bodies.resize(3);
  flight.bodies[1].twist = {1, 2, 3, 4, 5, 6};
  flight.bodies[1].twist_change = {0, 0, -1, 0, 0, 0};
  batch.add(flight);
  batch.add(scenes::make_body_stack(3, 6));
  return batch;
}

inline Case sweeps(Index iterations, double tolerance = 0) {
  Case how;
  how.options.iterations = iterations;
  how.options.tolerance = tolerance;
  return how;
}

template <class F>
std::string message_of(F&& f) {
  try {
    f();
  } catch (const Error& error) {
    return error.what();
  }
  return "nothing was thrown";
}

/// The residual of impulses by a judge that shares no code with the solver: of a matrix written out from definitions.
inline double verified(const BodyEnvironment<double>& env, const Case& how, const BodySolution<double>& solution) {
  ContactBatch<double> batch(how.options.law);
  batch.add(scenes::delassus_form(env, how.stepping));
  return verify(batch.view(), std::span<const double>(solution.impulse)).at(0).relative;
}

inline double largest_difference(const std::vector<double>& a, const std::vector<double>& b) {
  double largest = 0;
  for (std::size_t k = 0; k < a.size(); ++k) largest = std::max(largest, std::abs(a[k] - b[k]));
  return largest;
}

}  // namespace stiction::distributed
