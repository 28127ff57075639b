#include <gtest/gtest.h>

#include <limits>

#include "scenes/body_scenes.hpp"
#include "tests/support/machines/body_methods.hpp"
#include "tests/support/machines/scoped_isa.hpp"

/// Bits of the body form: whatever the threads, the instruction set and the neighbours.
namespace stiction::test {

namespace {

std::vector<BodyEnvironment<float>> mixed_environments() {
  std::vector<BodyEnvironment<float>> envs;
  for (std::uint64_t seed = 0; seed < 40; ++seed)
    envs.push_back(
        scenes::rounded(random_bodies(seed, 2 + static_cast<Index>(seed % 7), static_cast<Index>(3 * seed % 50))));
  envs.push_back({});
  envs.push_back(scenes::rounded(scenes::make_body_pile(1, 200)));
  return envs;
}

BodySolverOptions few_sweeps() {
  BodySolverOptions options;
  options.iterations = 20;
  options.threads = 1;
  options.invalid = InvalidPolicy::isolate;
  return options;
}

BodySolverOptions few_steps(BodyPreconditioner preconditioner) {
  BodySolverOptions options = few_sweeps();
  options.method = BodyMethod::newton;
  options.space.preconditioner = preconditioner;
  options.iterations = 6;
  options.tolerance = 1e-4;
  return options;
}

}  // namespace

TEST(Bodies, NewtonsMethodHasTheSameBitsOnEveryNumberOfThreadsAndInstructionSet) {
  const auto batch =
      batch_of<float>({scenes::rounded(random_bodies(1, 5, 20)), scenes::rounded(scenes::make_body_pile(2, 5000)),
                       scenes::rounded(random_bodies(2, 5, 20))});
  for (const BodyPreconditioner preconditioner : {BodyPreconditioner::block_diagonal, BodyPreconditioner::multigrid}) {
    BodySolverOptions options = few_steps(preconditioner);
    options.iterations = 2;
    const auto expected = solve_bodies(batch, {}, options);
    EXPECT_GT(expected.status[1].residual, 0);
    EXPECT_EQ(expected.status[1].iterations, 2);
    options.threads = 3;
    expect_same_bodies(expected, solve_bodies(batch, {}, options), "3 threads");
    const ScopedIsa narrowest(narrowest_isa());
    expect_same_bodies(expected, solve_bodies(batch, {}, options), narrowest_isa());
  }
}

TEST(Bodies, NewtonsMethodDoesNotDependOnNeighboursOrPlace) {
  const auto envs = mixed_environments();
  const auto batch = batch_of<float>(envs);
  for (const BodyPreconditioner preconditioner :
       {BodyPreconditioner::incomplete_cholesky, BodyPreconditioner::sparse_inverse, BodyPreconditioner::factor,
        BodyPreconditioner::multigrid}) {
    BodySolverOptions options = few_steps(preconditioner);
    const auto together = solve_bodies(batch, {}, options);
    options.threads = 3;
    for (std::size_t k = 0; k < envs.size(); ++k) {
      const auto alone = solve_bodies(batch_of<float>({envs[k]}), {}, options);
      expect_same_bodies(part_of(together, batch.view(), static_cast<Offset>(k)), alone,
                         "environment " + std::to_string(k));
    }
  }
}

TEST(Bodies, OneLargeEnvironmentHasTheSameBitsOnEveryNumberOfThreads) {
  // Large enough for a team (4096 contacts), and two small neighbours that are not.
  const auto batch =
      batch_of<float>({scenes::rounded(random_bodies(1, 5, 20)), scenes::rounded(scenes::make_body_pile(2, 6000)),
                       scenes::rounded(random_bodies(2, 5, 20))});
  for (const bool momentum : {false, true})
    for (const Index substeps : {1, 2}) {
      BodySolverOptions options = few_sweeps();
      options.momentum = momentum;
      options.substeps = substeps;
      const auto expected = solve_bodies(batch, {}, options);
      EXPECT_GT(expected.status[1].residual, 0);
      for (const int threads : {2, 3, 8}) {
        options.threads = threads;
        expect_same_bodies(expected, solve_bodies(batch, {}, options), std::to_string(threads) + " threads");
      }
    }
}

TEST(Bodies, EveryInstructionSetGivesTheSameBits) {
  const auto batch = batch_of<float>(mixed_environments());
  const auto expected = solve_bodies(batch, {}, few_sweeps());
  for (const char* name : usable_isas()) {
    const ScopedIsa isa(name);
    expect_same_bodies(expected, solve_bodies(batch, {}, few_sweeps()), name);
  }
}

TEST(Bodies, BoxedFrictionHasTheSameBitsOnEveryNumberOfThreadsAndInstructionSet) {
  auto envs = mixed_environments();
  envs.push_back(scenes::rounded(scenes::make_body_pile(2, 5000)));  // for a team of threads
  const auto batch = batch_of<float>(envs);
  BodySolverOptions options = few_sweeps();
  options.box_friction = true;
  const auto expected = solve_bodies(batch, {}, options);
  EXPECT_FALSE(same_bits(std::span<const float>(expected.impulse),
                         std::span<const float>(solve_bodies(batch, {}, few_sweeps()).impulse)));
  for (const int threads : {2, 5}) {
    options.threads = threads;
    expect_same_bodies(expected, solve_bodies(batch, {}, options), std::to_string(threads) + " threads");
  }
  for (const char* name : usable_isas()) {
    const ScopedIsa isa(name);
    expect_same_bodies(expected, solve_bodies(batch, {}, options), name);
  }
  options.law = Law::convex;
  expect_same_bodies(expected, solve_bodies(batch, {}, options), "a law that is not read");
}

TEST(Bodies, AnEnvironmentDoesNotDependOnItsNeighboursOrItsPlace) {
  const auto envs = mixed_environments();
  const auto batch = batch_of<float>(envs);
  const auto together = solve_bodies(batch, {}, few_sweeps());
  std::vector<BodyEnvironment<float>> shuffled;
  std::vector<std::size_t> place;
  for (std::size_t k = 0; k < envs.size(); ++k) {
    place.push_back((k * 25 + 7) % envs.size());
    shuffled.push_back(envs[place.back()]);
  }
  const auto other = batch_of<float>(shuffled);
  BodySolverOptions options = few_sweeps();
  options.threads = 3;
  const auto apart = solve_bodies(other, {}, options);
  for (std::size_t k = 0; k < envs.size(); ++k)
    expect_same_bodies(part_of(together, batch.view(), static_cast<Offset>(place[k])),
                       part_of(apart, other.view(), static_cast<Offset>(k)), "environment " + std::to_string(place[k]));
}

TEST(Bodies, APoisonedEnvironmentLeavesAllOthersAlone) {
  auto envs = mixed_environments();
  const auto clean = batch_of<float>(envs);
  const auto expected = solve_bodies(clean, {}, few_sweeps());
  for (const std::size_t k : {5U, 17U, 30U}) envs[k].contacts[0].normal[2] = std::numeric_limits<float>::quiet_NaN();
  envs[11].bodies[0].twist_change[0] = std::numeric_limits<float>::infinity();
  const auto poisoned = batch_of<float>(envs);
  const auto solution = solve_bodies(poisoned, {}, few_sweeps());
  for (std::size_t k = 0; k < envs.size(); ++k) {
    const auto env = static_cast<Offset>(k);
    if (k == 5 || k == 11 || k == 17 || k == 30) {
      EXPECT_EQ(solution.status[k].code, EnvCode::invalid_input);
      EXPECT_EQ(solution.status[k].flags, static_cast<std::uint32_t>(kFlagNonFiniteInput));
      for (const float v : part_of(solution, poisoned.view(), env).twist) EXPECT_EQ(v, 0.0F);
    } else {
      expect_same_bodies(part_of(expected, clean.view(), env), part_of(solution, poisoned.view(), env),
                         std::to_string(k));
    }
  }
}

}  // namespace stiction::test
