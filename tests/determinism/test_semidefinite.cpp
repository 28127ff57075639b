// Cones of semidefinite: the dependence of their bits, and bits that depend on them.
#include <gtest/gtest.h>

#include <vector>

#include "tests/support/machines/scoped_isa.hpp"
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
void expect_equal_bits_everywhere() {
  for (const SolverKind solver : {SolverKind::jacobi, SolverKind::apgd, SolverKind::admm, SolverKind::automatic}) {
    const Law law = solver == SolverKind::apgd ? Law::coulomb : Law::convex;
    SCOPED_TRACE(label(solver, law));
    const ContactBatch<Real> batch = convert<Real>(with_matrices(law));
    SolverOptions own = options(solver, 1e-4, 40);
    const auto expected = solve_hashes(batch, own);
    own.threads = 3;
    EXPECT_EQ(solve_hashes(batch, own), expected) << "threads";
    own.threads = 1;
    for (const char* isa : usable_shipped_isas()) {
      const ScopedIsa scope(isa);
      EXPECT_EQ(solve_hashes(batch, own), expected) << isa;
    }
    for (Offset env = 0; env < batch.env_count(); ++env) {
      const Offset only[] = {env};
      EXPECT_EQ(solve_hashes(gather(batch, only), own).front(), expected[static_cast<std::size_t>(env)])
          << "alone, " << env;
    }
    EXPECT_EQ(env_hashes(batch, solve(batch, own, Device::emulated())), expected) << "on the emulated device";
  }
}

TEST(Semidefinite, BitsDependNeitherOnThreadsNorOnTheMachine) {
  expect_equal_bits_everywhere<float>();
  expect_equal_bits_everywhere<double>();
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
