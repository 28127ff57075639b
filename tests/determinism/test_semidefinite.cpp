// Cones of semidefinite: the dependence of their bits, and bits that depend on them.
#include <gtest/gtest.h>

#include <vector>

#include "tests/support/machines/same_everywhere.hpp"
#include "tests/support/systems/scene_batches.hpp"
#include "tests/support/systems/semidefinite_systems.hpp"
#include "tests/support/systems/small_systems.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

/// Environments of 10 to 120 rows with matrices, and others without any between them.
ContactBatch<double> with_matrices(Law law) {
  ContactBatch<double> batch(law);
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    MatrixRecipe recipe;
    recipe.seed = seed;
    recipe.matrices = seed == 6 ? 20 : static_cast<int>(seed);
    recipe.contacts = static_cast<int>(seed % 3);
    batch.add(random_with_matrices(recipe));
    recipe.matrices = 0;
    recipe.contacts = 3;
    batch.add(random_with_matrices(recipe));
  }
  return batch;
}

template <class Real>
void expect_equal_bits() {
  for (const SolverKind solver : {SolverKind::jacobi, SolverKind::apgd, SolverKind::admm, SolverKind::automatic}) {
    const Law law = solver == SolverKind::apgd ? Law::coulomb : Law::convex;
    SCOPED_TRACE(label(solver, law));
    expect_equal_bits_everywhere(convert<Real>(with_matrices(law)), options(solver, 1e-4, 40));
  }
}

TEST(Semidefinite, BitsDependNeitherOnThreadsNorOnTheMachine) {
  expect_equal_bits<float>();
  expect_equal_bits<double>();
}

TEST(Semidefinite, TheLawOfTheBatchDoesNotReachIt) {
  MatrixRecipe recipe;
  recipe.seed = 4;
  recipe.contacts = 0;
  const Environment<double> env = random_with_matrices(recipe);
  for (const SolverKind solver : {SolverKind::jacobi, SolverKind::apgd, SolverKind::admm}) {
    const auto hash = [&](Law law) { return solve_hashes(batch_of({env}, law), options(solver, 1e-6, 60)); };
    EXPECT_EQ(hash(Law::convex), hash(Law::coulomb)) << to_string(solver);
  }
}

}  // namespace
