#include <gtest/gtest.h>

#include <vector>

#include "stiction/hash.hpp"
#include "stiction/residual.hpp"
#include "tests/c_api/c_views.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/systems/jacobian_systems.hpp"
#include "tests/support/systems/velocity_cases.hpp"

#ifdef STICTION_TEST_HAS_IO
#include "stiction/io.hpp"
#endif

// The C interface against the C++ one in the same process: the same problems, the same bits, whatever the struct.
namespace {

using namespace stiction;
using namespace stiction::test;

/// One batch through both interfaces, under options that are not the defaults.
template <class Real>
void same_contacts(const ContactBatch<Real>& batch, SolverKind kind) {
  SCOPED_TRACE(to_string(kind));
  SolverOptions options;
  options.solver = kind;
  options.law = Law::convex;
  options.tolerance = 1e-3;
  options.max_iterations = 77;
  options.omega = 1.25;
  const Solution<Real> expected = solve(batch, options);

  stiction_solver_options same;
  stiction_solver_options_init(&same, sizeof same);
  same.solver = static_cast<std::int32_t>(kind);
  same.law = STICTION_LAW_CONVEX;
  same.tolerance = 1e-3;
  same.max_iterations = 77;
  same.omega = 1.25;
  stiction_solver* solver = nullptr;
  STICTION_OK_OR_SAY(stiction_solver_create("cpu", &same, nullptr, &solver));
  Solution<Real> found = room_for<Real>(batch.row_count(), batch.env_count());
  const stiction_solution answer = c_view(found);
  const stiction_batch_view view = c_view(batch.view());
  STICTION_OK_OR_SAY(stiction_solver_solve(solver, &view, &answer, nullptr, nullptr));
  EXPECT_TRUE(same_bits(expected, found));
  std::uint64_t hash = 0;
  STICTION_OK_OR_SAY(stiction_hash(kPrecision<Real>, found.lambda.data(), batch.row_count(), &hash));
  EXPECT_EQ(hash, hash_bits(std::span<const Real>(expected.lambda)));

  std::vector<stiction_residual> judged(static_cast<std::size_t>(batch.env_count()));
  STICTION_OK_OR_SAY(stiction_verify(&view, found.lambda.data(), judged.data()));
  const auto residuals = verify(batch.view(), std::span<const Real>(found.lambda));
  for (std::size_t e = 0; e < judged.size(); ++e) {
    EXPECT_EQ(judged[e].relative, residuals[e].relative);
    EXPECT_EQ(judged[e].absolute, residuals[e].absolute);
  }
  STICTION_OK_OR_SAY(stiction_solver_destroy(solver));
}

TEST(CSameBits, ContactBatchesOfEitherPrecision) {
  const ContactBatch<double> batch = contacts();
  for (const SolverKind kind : {SolverKind::pgs, SolverKind::npgs, SolverKind::ipm, SolverKind::automatic}) {
    same_contacts(batch, kind);
    same_contacts(convert<float>(batch), kind);
  }
}

TEST(CSameBits, JacobianBatches) {
  JacobianBatch<double> batch(Law::coulomb);
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    JacobianRecipe recipe;
    recipe.seed = seed;
    batch.add(random_jacobian(recipe));
  }
  const auto expected = solve(batch, SolverOptions{}, Device::cpu(), {}, FactorUse::always);
  const stiction_jacobian_view view = c_view(batch.view());
  stiction_jacobian_capacity capacity;
  stiction_jacobian_capacity_init(&capacity, sizeof capacity);
  capacity.factor_use = STICTION_FACTOR_ALWAYS;
  STICTION_OK_OR_SAY(stiction_jacobian_capacity_of(&view, &capacity));
  stiction_jacobian_solver* solver = nullptr;
  STICTION_OK_OR_SAY(stiction_jacobian_solver_create("cpu", nullptr, &capacity, &solver));
  Solution<double> found = room_for<double>(batch.row_count(), batch.env_count());
  std::vector<double> velocity(static_cast<std::size_t>(batch.dof_count()));
  stiction_jacobian_solution answer;
  stiction_jacobian_solution_init(&answer, sizeof answer);
  answer.lambda = found.lambda.data();
  answer.w = found.w.data();
  answer.velocity = velocity.data();
  answer.status = records(found.status);
  STICTION_OK_OR_SAY(stiction_jacobian_solver_solve(solver, &view, &answer, nullptr, nullptr));
  EXPECT_TRUE(same_bits(expected.contact, found));
  EXPECT_TRUE(same_bits(std::span<const double>(expected.velocity), std::span<const double>(velocity)));

  STICTION_OK_OR_SAY(stiction_jacobian_solver_destroy(solver));
}

TEST(CSameBits, JacobianBatchesFromVelocities) {
  JacobianBatch<double> batch;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) batch.add(random_chain({seed, 12}));
  SolverOptions options;
  options.solver = SolverKind::automatic;
  const auto cold = solve(batch, options);
  std::vector<double> start(cold.velocity);
  for (double& one : start) one *= 1.001;
  Solution<double> expected = room_for<double>(batch.row_count(), batch.env_count());
  std::vector<double> reached(start);
  JacobianSolver<double> same(Device::cpu(), options, {});
  same.solve(batch.view(), {expected.lambda.data(), expected.w.data(), reached.data(), expected.status.data()},
             JacobianStart<double>{nullptr, start.data()});
  EXPECT_NE(cold.contact.lambda, expected.lambda) << "the start was not read";

  // From the answer's own array.
  const stiction_jacobian_view view = c_view(batch.view());
  stiction_jacobian_capacity capacity;
  stiction_jacobian_capacity_init(&capacity, sizeof capacity);
  STICTION_OK_OR_SAY(stiction_jacobian_capacity_of(&view, &capacity));
  stiction_solver_options chosen;
  stiction_solver_options_init(&chosen, sizeof chosen);
  chosen.solver = static_cast<std::int32_t>(SolverKind::automatic);
  stiction_jacobian_solver* solver = nullptr;
  STICTION_OK_OR_SAY(stiction_jacobian_solver_create("cpu", &chosen, &capacity, &solver));
  Solution<double> found = room_for<double>(batch.row_count(), batch.env_count());
  stiction_jacobian_solution answer;
  stiction_jacobian_solution_init(&answer, sizeof answer);
  answer.lambda = found.lambda.data();
  answer.w = found.w.data();
  answer.velocity = start.data();
  answer.status = records(found.status);
  STICTION_OK_OR_SAY(stiction_jacobian_solver_solve_from(solver, &view, &answer, nullptr, start.data(), nullptr));
  EXPECT_TRUE(same_bits(expected, found));
  EXPECT_TRUE(same_bits(std::span<const double>(reached), std::span<const double>(start)));
  STICTION_OK_OR_SAY(stiction_jacobian_solver_destroy(solver));
}

/// Several batches through one handle. It has to see that a plan no longer holds, be it for the depths, by which a
/// capacity leaves contacts out.
void expect_same_bodies(bool boxed) {
  BodySolverOptions options;
  options.box_friction = boxed;
  options.substeps = 2;
  options.max_contacts_per_env = 9;
  TimeStepping stepping;
  stepping.dt = 0.01;
  stepping.erp = 0.3;
  stiction_body_options same;
  stiction_body_options_init(&same, sizeof same);
  if (boxed) same.law = STICTION_LAW_BOXED;
  same.substeps = 2;
  same.max_contacts_per_env = 9;
  stiction_time_stepping step;
  stiction_time_stepping_init(&step, sizeof step);
  step.dt = 0.01;
  step.erp = 0.3;
  stiction_body_solver* solver = nullptr;
  STICTION_OK_OR_SAY(stiction_body_solver_create("cpu", &step, &same, &solver));
  struct Case {
    std::uint64_t seed;
    double press;
  };
  for (const Case& one : {Case{1, 0}, {1, 0}, {1, 1}, {1, -1}, {5, 0}, {9, 0}}) {
    const BodyBatch<double> batch = thrown_bodies(one.seed, one.press);
    const auto expected = solve_bodies(batch, stepping, options);
    std::vector<double> impulse(expected.impulse.size()), twist(expected.twist.size()), w(expected.w.size());
    std::vector<EnvStatus> status(expected.status.size());
    stiction_body_solution answer;
    stiction_body_solution_init(&answer, sizeof answer);
    answer.impulse = impulse.data();
    answer.twist = twist.data();
    answer.w = w.data();
    answer.status = records(status);
    const stiction_body_view view = c_view(batch.view());
    STICTION_OK_OR_SAY(stiction_body_solver_solve(solver, &view, &answer, nullptr, nullptr));
    EXPECT_TRUE(same_bits(std::span<const double>(expected.impulse), std::span<const double>(impulse)));
    EXPECT_TRUE(same_bits(std::span<const double>(expected.twist), std::span<const double>(twist)));
    EXPECT_TRUE(same_bits(std::span<const double>(expected.w), std::span<const double>(w)));
    EXPECT_TRUE(same_bits(std::span<const EnvStatus>(expected.status), std::span<const EnvStatus>(status)));
  }
  STICTION_OK_OR_SAY(stiction_body_solver_destroy(solver));
}

TEST(CSameBits, BodiesWhoseStructureChanges) {
  expect_same_bodies(false);
}

TEST(CSameBits, BodiesWithBoxedFriction) {
  expect_same_bodies(true);
}

#ifdef STICTION_TEST_HAS_IO
TEST(CSameBits, ASolutionFileHoldsTheSolution) {
  const ContactBatch<float> batch = convert<float>(contacts());
  Solution<float> solution = solve(batch);
  const stiction_batch_view view = c_view(batch.view());
  const stiction_solution answer = c_view(solution);
  stiction_solver_options options;
  stiction_solver_options_init(&options, sizeof options);
  options.law = STICTION_LAW_CONVEX;
  const std::string path = ::testing::TempDir() + "stiction_c_solution.h5";
  STICTION_OK_OR_SAY(stiction_solution_write(path.c_str(), &view, &answer, &options, "a test"));
  const io::SolutionFile file = io::read_solution(path);
  EXPECT_EQ(file.precision, Precision::f32);
  EXPECT_EQ(file.law, Law::convex);
  EXPECT_EQ(file.solver, "npgs");
  EXPECT_EQ(file.source, "a test");
  EXPECT_EQ(file.env_row_offsets, batch.arrays().env_row_offsets);
  EXPECT_EQ(file.lambda, std::vector<double>(solution.lambda.begin(), solution.lambda.end()));
  EXPECT_EQ(file.w, std::vector<double>(solution.w.begin(), solution.w.end()));
  EXPECT_TRUE(same_bits(std::span<const EnvStatus>(solution.status), std::span<const EnvStatus>(file.status)));
}
#endif

}  // namespace
