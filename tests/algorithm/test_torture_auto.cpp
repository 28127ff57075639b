#include <gtest/gtest.h>

#include <set>

#include "tests/support/machines/every_solver.hpp"
#include "tests/support/machines/on_engine.hpp"

/// The whole chain of SolverKind::automatic: which environment begins where, which goes on, the sorting between, and
/// every stage from the answer before. Its teams are of the emulated device: threads that meet at barriers and nowhere
/// else.
namespace stiction::test {
namespace {

SolverOptions chain(Law law, double tolerance) {
  SolverOptions options;
  options.solver = SolverKind::automatic;
  options.law = law;
  options.tolerance = tolerance;
  options.max_iterations = 2;  // most reach the last stage
  options.invalid = InvalidPolicy::isolate;
  options.threads = 1;
  return options;
}

/// Environments of every scene with at most that many rows, or without friction, as the pivoting stage takes them.
ContactBatch<double> late_stages(Index rows) {
  const ContactBatch<double> with_friction = up_to(ragged_batch(1, 4), rows);
  const ContactBatch<double> without = up_to(linearise(up_to(ragged_batch(1, 6), rows), 4).batch, rows);
  ContactBatch<double> batch(Law::coulomb);
  for (const ContactBatch<double>& part : {with_friction, without})
    for (Offset env = 0; env < part.env_count(); ++env) batch.add(environment_of(part.view(), env));
  return batch;
}

/// On teams of `lanes` lanes, small environments included.
template <class Real>
void expect_the_same_on_teams(const ContactBatch<double>& batch_of_doubles, Law law, double tolerance, int lanes) {
  SCOPED_TRACE(std::to_string(lanes) + " lanes, " + to_string(law));
  const ContactBatch<Real> batch = convert<Real>(batch_of_doubles);
  const SolverOptions options = chain(law, tolerance);
  cuda::EmulatedDevice device({lanes, 2, static_cast<std::uint64_t>(lanes)});
  EXPECT_EQ(on_engine(device, batch, options, cuda::ClassRules::from(SizeClass::dense_block)),
            solve_hashes(batch, options));
}

TEST(Torture, TheLadderHasTheSameBitsOnTeamsOfAFewLanes) {
  const ContactBatch<double> batch = late_stages(40);
  ASSERT_GE(batch.env_count(), 8);
  for (const int lanes : {1, 2, 3, 8}) {
    expect_the_same_on_teams<float>(batch, Law::convex, 1e-6, lanes);
    expect_the_same_on_teams<double>(batch, Law::coulomb, 1e-10, lanes);
  }
}

TEST(Torture, TheLadderHasTheSameBitsOnTeamsOfMoreLanesThanRows) {
  const ContactBatch<double> batch = late_stages(12);
  ASSERT_GE(batch.env_count(), 2);
  expect_the_same_on_teams<float>(batch, Law::coulomb, 1e-6, 33);
  expect_the_same_on_teams<double>(batch, Law::convex, 1e-10, 33);
}

/// A sparse environment, whose stages run on another kind of system.
TEST(Torture, TheLadderHasTheSameBitsOnASparseEnvironment) {
  ContactBatch<double> batch(Law::coulomb);
  batch.add(scenes::make("stack", 5, 0, 7).system);
  ASSERT_GT(batch.row_count(), 64);
  expect_the_same_on_teams<double>(batch, Law::coulomb, 1e-10, 3);
}

/// Tests the chain above: stages that answer when each may iterate as long as it takes.
TEST(Torture, EnvironmentsOfTheChainEndOnSeveralRungs) {
  SolverOptions patient = chain(Law::coulomb, 1e-9);
  patient.max_iterations = 500;
  std::set<SolverKind> answered;
  for (const EnvStatus& status : solve(late_stages(70), patient).status) answered.insert(status.solver);
  EXPECT_GE(answered.size(), 2U);
}

}  // namespace
}  // namespace stiction::test
