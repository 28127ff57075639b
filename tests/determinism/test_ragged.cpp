#include <gtest/gtest.h>

#include <numeric>

#include "core/plan/plan.hpp"
#include "tests/support/systems/scene_batches.hpp"
#include "tests/support/systems/small_systems.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

TEST(Ragged, ABatchWithoutEnvironmentsIsSolvedByDoingNothing) {
  for (const SolverKind solver : kEverySolver) {
    const Solution<double> solution = solve(ContactBatch<double>(), options(solver, 1e-6, 10));
    EXPECT_TRUE(solution.lambda.empty());
    EXPECT_TRUE(solution.status.empty());
  }
}

TEST(Ragged, EnvironmentsWithoutRowsAreSolvedAtOnce) {
  const auto batch = batch_of(std::vector<Environment<double>>(37));
  for (const SolverKind solver : kEverySolver) {
    const Solution<double> solution = solve(batch, options(solver, 1e-6, 10));
    ASSERT_EQ(solution.status.size(), 37U);
    for (const EnvStatus& status : solution.status) {
      EXPECT_EQ(status.code, EnvCode::solved);
      EXPECT_EQ(status.solver, solver);
      EXPECT_EQ(status.iterations, 0);
      EXPECT_EQ(status.residual, 0.0);
      EXPECT_EQ(status.flags, 0U);
    }
  }
}

TEST(Ragged, TenThousandContactsAmongSmallEnvironmentsChangeNoneOfThem) {
  for (const char* name : {"chain", "column"}) {
    SCOPED_TRACE(name);
    ContactBatch<double> batch(Law::coulomb);
    std::vector<Offset> small;
    const auto add_small = [&](std::uint64_t seed) {
      for (std::uint64_t e = 0; e < 9; ++e) {
        small.push_back(batch.env_count());
        batch.add(scenes::make(e % 3 == 0 ? "stack" : "mixed", seed, e, e % 3 == 0 ? 2 : 16).system);
      }
    };
    add_small(1);
    const Offset giant = batch.env_count();
    batch.add(scenes::make(name, 1, 0, 10000).system);
    add_small(2);
    const auto rows = batch.arrays().env_row_offsets;
    ASSERT_GE(rows[static_cast<std::size_t>(giant) + 1] - rows[static_cast<std::size_t>(giant)], 10000);
    ASSERT_EQ(make_plan(batch.view()).path[static_cast<std::size_t>(giant)], EnvPath::sparse);

    const SolverOptions o = options(SolverKind::npgs, 1e-3, 24);
    const Solution<double> whole = solve(batch, o);
    const auto hashes = env_hashes(batch, whole);
    const auto apart = solve_hashes(gather<double>(batch, small), o);
    for (std::size_t i = 0; i < small.size(); ++i)
      EXPECT_EQ(apart[i], hashes[static_cast<std::size_t>(small[i])]) << "environment " << small[i];
    const Offset only[] = {giant};
    EXPECT_EQ(solve_hashes(gather<double>(batch, only), o).at(0), hashes[static_cast<std::size_t>(giant)]);
    EXPECT_GT(whole.status[static_cast<std::size_t>(giant)].iterations, 0);
  }
}

TEST(Ragged, SizesFromZeroToManyContactsInOneCallAreAllAnswered) {
  const auto batch = ragged_batch(6, 17);
  for (const SolverKind solver : kAllSolvers) {
    const Solution<double> solution = solve(batch, options(solver, 1e-2, 400));
    for (const EnvStatus& status : solution.status) {
      EXPECT_TRUE(status.code == EnvCode::solved || status.code == EnvCode::max_iterations) << to_string(status.code);
      EXPECT_EQ(status.solver, solver);
    }
  }
}

}  // namespace
