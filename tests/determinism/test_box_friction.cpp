// Boxed friction: the dependence of its bits, and bits that depend on it.
#include <gtest/gtest.h>

#include <algorithm>
#include <initializer_list>
#include <vector>

#include "tests/support/machines/same_everywhere.hpp"
#include "tests/support/systems/boxed.hpp"
#include "tests/support/systems/random_systems.hpp"
#include "tests/support/systems/scene_batches.hpp"
#include "tests/support/systems/small_systems.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

/// Scenes of many sizes with all or some of their friction boxed: dense and sparse environments.
ContactBatch<double> boxed_scenes(Offset envs_each) {
  const ContactBatch<double> plain = ragged_batch(envs_each, 11);
  ContactBatch<double> batch(plain.law());
  for (Offset e = 0; e < plain.env_count(); ++e) {
    const Environment<double> env = environment_of(plain.view(), e);
    batch.add(e % 3 == 2 ? env : boxed(env, e % 3 == 0));
  }
  return batch;
}

template <class Real>
void expect_equal_bits(const ContactBatch<Real>& batch, std::initializer_list<SolverKind> solvers, double tolerance,
                       Index iterations) {
  for (const SolverKind solver : solvers) {
    SCOPED_TRACE(to_string(solver));
    expect_equal_bits_everywhere(batch, options(solver, tolerance, iterations));
  }
}

/// All boxed, with few axes: dense environments, and one that is sparse by further rows which touch nothing.
ContactBatch<double> pivoted_scenes() {
  ContactBatch<double> batch;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    Recipe recipe;
    recipe.seed = seed;
    recipe.contacts = 1 + static_cast<int>(seed % 7);
    recipe.mu_max = 3;
    batch.add(boxed(random_conditioned(recipe, 100)));
  }
  Environment<double> sparse = environment_of(batch.view(), 4);
  for (Index row = static_cast<Index>(sparse.b.size()); row < 80; ++row) {
    sparse.cones.push_back(unilateral());
    sparse.column.push_back(row);
    sparse.A.push_back(2);
    sparse.row_offsets.push_back(static_cast<Index>(sparse.A.size()));
    sparse.b.push_back(row % 3 == 0 ? 1 : -1);
    for (auto* numbers : {&sparse.R, &sparse.mu, &sparse.lo, &sparse.hi}) numbers->push_back(0);
  }
  batch.add(sparse);
  return batch;
}

TEST(BoxFriction, BitsDependNeitherOnThreadsNorOnPacksNorOnTheMachine) {
  const std::initializer_list<SolverKind> sweeps = {SolverKind::pgs, SolverKind::npgs, SolverKind::jacobi,
                                                    SolverKind::nsgs};
  const ContactBatch<double> scenes = boxed_scenes(3);
  expect_equal_bits(convert<float>(scenes), sweeps, 1e-4, 40);
  expect_equal_bits(scenes, sweeps, 1e-4, 40);
}

TEST(BoxFriction, BitsOfPivotsDoNeither) {
  const std::initializer_list<SolverKind> pivots = {SolverKind::lemke, SolverKind::automatic};
  const ContactBatch<double> scenes = pivoted_scenes();
  const Solution<double> chosen = solve(scenes, options(SolverKind::automatic, 1e-10, 200));
  EXPECT_GE(std::count_if(chosen.status.begin(), chosen.status.end(),
                          [](const EnvStatus& status) { return status.solver == SolverKind::lemke; }),
            2);
  EXPECT_EQ(solve(scenes, options(SolverKind::lemke, 1e-10, 400)).status.back().code, EnvCode::solved) << "sparse";
  expect_equal_bits(convert<float>(scenes), pivots, 1e-5, 200);
  expect_equal_bits(scenes, pivots, 1e-10, 200);
}

TEST(BoxFriction, AFrictionConeBesideItHasTheBitsThatItHasWithoutIt) {
  // Two islands in one environment, and the batch's other environments: boxed cones reach neither.
  const ContactBatch<double> plain = ragged_batch(2, 5);
  ContactBatch<double> beside(plain.law());
  for (Offset e = 0; e < plain.env_count(); ++e) {
    beside.add(environment_of(plain.view(), e));
    beside.add(boxed(environment_of(plain.view(), e)));
  }
  for (const SolverKind solver : {SolverKind::npgs, SolverKind::subspace, SolverKind::apgd}) {
    const SolverOptions own = options(solver, 1e-4, 40);
    const auto expected = solve_hashes(plain, own);
    const auto found = solve_hashes(beside, own);
    for (std::size_t e = 0; e < expected.size(); ++e) EXPECT_EQ(found[2 * e], expected[e]) << to_string(solver) << e;
  }
}

TEST(BoxFriction, TheLawOfTheBatchDoesNotReachIt) {
  const Environment<double> env = boxed(scenes::make("stack", 3, 0, 4).system);
  for (const SolverKind solver : {SolverKind::pgs, SolverKind::npgs, SolverKind::jacobi, SolverKind::nsgs}) {
    const auto hash = [&](Law law) { return solve_hashes(batch_of({env}, law), options(solver, 1e-6, 60)); };
    EXPECT_EQ(hash(Law::convex), hash(Law::coulomb)) << to_string(solver);
  }
}

}  // namespace
