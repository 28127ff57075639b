#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/plan/islands.hpp"
#include "stiction/hash.hpp"
#include "tests/support/systems/scene_batches.hpp"
#include "tests/support/systems/small_systems.hpp"

/// Separate tolerance and iterations for every environment: each gets the result of a solve with those options.
namespace stiction::test {
namespace {

constexpr double kTolerances[] = {1e-1, 1e-3, -1.0, 0.0, std::numeric_limits<double>::quiet_NaN()};
constexpr Index kIterations[] = {3, 40, -1, 7};

template <class Real>
ContactBatch<Real> with_limits(const ContactBatch<Real>& batch) {
  auto arrays = batch.arrays();
  for (std::size_t env = 0; env + 1 < arrays.env_row_offsets.size(); ++env) {
    arrays.env_tolerance.push_back(kTolerances[env % std::size(kTolerances)]);
    arrays.env_max_iterations.push_back(kIterations[env % std::size(kIterations)]);
  }
  return ContactBatch<Real>::from_arrays(batch.law(), std::move(arrays));
}

template <class Real>
void expect_own_limits(SolverKind solver, Device device, IslandMode islands = IslandMode::together) {
  const ContactBatch<Real> batch = convert<Real>(ragged_batch(3, 4));
  SolverOptions general = options(solver, 1e-2, 30);
  general.islands = islands;
  const Solution<Real> together = solve(with_limits(batch), general, device);
  const auto hashes = env_hashes(batch, together);
  for (Offset env = 0; env < batch.env_count(); ++env) {
    SolverOptions own = general;
    const double tolerance = kTolerances[static_cast<std::size_t>(env) % std::size(kTolerances)];
    const Index iterations = kIterations[static_cast<std::size_t>(env) % std::size(kIterations)];
    if (tolerance >= 0.0) own.tolerance = tolerance;
    if (iterations >= 0) own.max_iterations = iterations;
    const ContactBatch<Real> alone = gather(batch, std::vector<Offset>{env});
    EXPECT_EQ(env_hashes(alone, solve(alone, own))[0], hashes[static_cast<std::size_t>(env)]) << env;
  }
}

TEST(EnvLimits, EachEnvironmentStopsByItsOwnOnTheCpu) {
  expect_own_limits<float>(SolverKind::npgs, Device::cpu());
  expect_own_limits<double>(SolverKind::apgd, Device::cpu());
}

TEST(EnvLimits, EachEnvironmentStopsByItsOwnOnADevice) {
  expect_own_limits<float>(SolverKind::npgs, Device::emulated());
}

TEST(EnvLimits, EveryIslandHasItsEnvironmentsOwn) {
  const ContactBatch<double> batch = ragged_batch(3, 4);
  const Islands islands = find_islands(batch.view());
  ASSERT_GT(*std::max_element(islands.count.begin(), islands.count.end()), 1);
  expect_own_limits<double>(SolverKind::npgs, Device::cpu(), IslandMode::apart);
}

/// Twelve of one environment as a pack, and one of them alone. Returns how the latter ended.
template <class Real>
EnvCode code_alike_alone(SolverKind solver, const Environment<double>& env, double tolerance, Index iterations) {
  ContactBatch<double> batch(Law::convex);
  for (int k = 0; k < 12; ++k) batch.add(env);
  auto arrays = convert<Real>(batch).arrays();
  arrays.env_tolerance.assign(12, tolerance);
  const auto all = ContactBatch<Real>::from_arrays(Law::convex, std::move(arrays));
  SolverOptions o = options(solver, 1e-4, iterations);
  o.invalid = InvalidPolicy::isolate;
  const Solution<Real> together = solve(all, o);
  const ContactBatch<Real> one = gather(all, std::vector<Offset>{5});
  const Solution<Real> alone = solve(one, o);
  EXPECT_EQ(env_hashes(one, alone)[0], env_hashes(all, together)[5]) << to_string(solver);
  EXPECT_EQ(alone.status[0].iterations, together.status[5].iterations) << to_string(solver);
  EXPECT_EQ(alone.status[0].code, together.status[5].code) << to_string(solver);
  return alone.status[0].code;
}

constexpr SolverKind kInPacks[] = {SolverKind::pgs, SolverKind::npgs, SolverKind::jacobi, SolverKind::apgd};

TEST(EnvLimits, TheLeastToleranceIsNotNoneInAPackEither) {
  // A fuzzer's: in single precision a pack took it for 0, by which every iteration is asked for.
  const auto env = system({unilateral(), unilateral()}, {1.3, 0.1, 0.1, 1.2}, {-3.3, -7.7});
  for (const SolverKind solver : kInPacks)
    EXPECT_EQ(code_alike_alone<float>(solver, env, std::numeric_limits<double>::denorm_min(), 400), EnvCode::rounding);
}

TEST(EnvLimits, AFreeRowThatItsReactionDoesNotMoveWeighsAlike) {
  // A fuzzer's: reactions of 1e10 are rounded beyond the allowance, which a pack did not see.
  const auto env =
      system({free_row(), friction(2), free_row()},
             {-1.4e-45, -0.0566, 0, 0, 4e-31, 1.27, 0.114, 0, 0, 0.114, 1.047, -0.0264, 0, 0, -0.0264, 1.27},
             {-7.3, 7.8, -7.06, -7.375});
  for (const SolverKind solver : kInPacks) {
    const EnvCode code = code_alike_alone<float>(solver, env, -1.0, 12);
    EXPECT_TRUE(code == EnvCode::rounding || solver != SolverKind::jacobi);
  }
}

TEST(EnvLimits, CrossedBoundsAreCrossedInAPackThoughOneIsInfinite) {
  auto env = system({box()}, {1}, {1});
  for (const auto& [lo, hi] : {std::pair{1e30, 1e25}, std::pair{-1e25, -1e30}, std::pair{1.0, -1.0}}) {
    env.lo = {lo};
    env.hi = {hi};
    for (const SolverKind solver : kInPacks) {
      EXPECT_EQ(code_alike_alone<float>(solver, env, -1.0, 40), EnvCode::invalid_input);
      EXPECT_EQ(code_alike_alone<double>(solver, env, -1.0, 40), EnvCode::invalid_input);
    }
  }
}

TEST(EnvLimits, TheyTravelWithTheEnvironment) {
  const ContactBatch<double> batch = with_limits(scene_batch("mixed", 9, 1));
  const std::vector<Offset> order = {8, 3, 3, 0};
  const ContactBatch<double> gathered = gather(batch, order);
  for (std::size_t k = 0; k < order.size(); ++k) {
    EXPECT_EQ(gathered.view().env_max_iterations[k], batch.view().env_max_iterations[order[k]]);
    EXPECT_EQ(std::signbit(gathered.view().env_tolerance[k]), std::signbit(batch.view().env_tolerance[order[k]]));
  }
  EXPECT_EQ(convert<float>(batch).arrays().env_max_iterations, batch.arrays().env_max_iterations);
}

}  // namespace
}  // namespace stiction::test
