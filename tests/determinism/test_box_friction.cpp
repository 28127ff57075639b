// Boxed friction: what its bits depend on, and which bits depend on it.
#include <gtest/gtest.h>

#include <vector>

#include "tests/support/boxed.hpp"
#include "tests/support/scene_batches.hpp"
#include "tests/support/scoped_isa.hpp"
#include "tests/support/small_systems.hpp"

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
void expect_equal_bits_everywhere() {
  const ContactBatch<Real> batch = convert<Real>(boxed_scenes(3));
  for (const SolverKind solver : {SolverKind::pgs, SolverKind::npgs, SolverKind::jacobi, SolverKind::nsgs}) {
    SCOPED_TRACE(to_string(solver));
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
    const auto emulated = env_hashes(batch, solve(batch, own, Device::emulated()));
    EXPECT_EQ(emulated, expected) << "on the emulated device";
  }
}

TEST(BoxFriction, BitsDependNeitherOnThreadsNorOnPacksNorOnTheMachine) {
  expect_equal_bits_everywhere<float>();
  expect_equal_bits_everywhere<double>();
}

TEST(BoxFriction, AFrictionConeBesideItHasTheBitsThatItHasWithoutIt) {
  // Two islands in one environment, and the batch's other environments: what is boxed reaches neither.
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
