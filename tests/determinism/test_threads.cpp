#include <gtest/gtest.h>

#include "tests/support/sanitizers.hpp"
#include "tests/support/systems/scene_batches.hpp"
#include "tests/support/systems/small_systems.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

template <class Real>
class Threads : public testing::Test {};
using Precisions = testing::Types<float, double>;
TYPED_TEST_SUITE(Threads, Precisions);

TYPED_TEST(Threads, TheNumberOfThreadsReachesNoBitOfAnyEnvironment) {
  const ContactBatch<TypeParam> batch = convert<TypeParam>(ragged_batch(5, 3));
  for (const SolverKind solver : kEverySolver) {
    SCOPED_TRACE(to_string(solver));
    // Methods that factorise take a second an iteration on the largest of these.
    const bool factorises = solver == SolverKind::admm || solver == SolverKind::newton || solver == SolverKind::ipm;
    const Index iterations = kSanitizer ? 2 : 40;
    SolverOptions o = options(solver, 1e-3, factorises ? (kSanitizer ? 1 : 4) : iterations);
    const auto alone = solve_hashes(batch, o);
    for (const int threads : {2, 7}) {
      o.threads = threads;
      EXPECT_EQ(solve_hashes(batch, o), alone) << threads << " threads";
    }
  }
}

TYPED_TEST(Threads, ManyRunsOnManyThreadsAgree) {
  const ContactBatch<TypeParam> batch = convert<TypeParam>(scene_batch("mixed", 40, 8, 48));
  SolverOptions o = options(SolverKind::npgs, 1e-4, 60);
  o.threads = 7;
  const auto first = solve_hashes(batch, o);
  for (int run = 0; run < (kSanitizer ? 3 : 8); ++run) EXPECT_EQ(solve_hashes(batch, o), first) << "run " << run;
}

}  // namespace
