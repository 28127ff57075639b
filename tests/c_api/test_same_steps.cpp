#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "stiction/stepping.hpp"
#include "tests/c_api/c_views.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/systems/jacobian_systems.hpp"

// Simulation loops through the C interface against the C++ one: the same bits, step by step, in every form.
namespace {

using namespace stiction;
using namespace stiction::test;

/// Three steps of different lengths, so that options of the warm start reach the answers.
TEST(CSameSteps, OfContactBatches) {
  const ContactBatch<double> batch = contacts();
  std::vector<std::uint64_t> cone_id;
  for (std::uint64_t cone = 0; cone < static_cast<std::uint64_t>(batch.view().cone_count); ++cone)
    cone_id.push_back(1000 - cone);
  WarmStartOptions warm;
  warm.beta = 0.5;
  warm.scaling = StepScaling::proportional;
  const Capacity room = Capacity::of(batch.view());
  SteppingSolver<double> stepper(Device::cpu(), SolverOptions{}, room, warm);

  stiction_warm_start_options same;
  stiction_warm_start_options_init(&same, sizeof same);
  same.beta = 0.5;
  same.scaling = STICTION_STEP_PROPORTIONAL;
  const stiction_batch_view view = c_view(batch.view());
  stiction_capacity capacity;
  stiction_capacity_init(&capacity, sizeof capacity);
  STICTION_OK_OR_SAY(stiction_capacity_of(&view, &capacity));
  stiction_stepping_solver* solver = nullptr;
  STICTION_OK_OR_SAY(stiction_stepping_solver_create("cpu", nullptr, &capacity, &same, &solver));
  for (const double dt : {0.01, 0.005, 0.02}) {
    Solution<double> expected = room_for<double>(batch.row_count(), batch.env_count());
    Solution<double> found = expected;
    stepper.solve(batch.view(), cone_id.data(), dt,
                  {expected.lambda.data(), expected.w.data(), expected.status.data()});
    const stiction_solution answer = c_view(found);
    STICTION_OK_OR_SAY(stiction_stepping_solver_solve(solver, &view, cone_id.data(), dt, &answer, nullptr));
    EXPECT_TRUE(same_bits(expected, found));
  }
  STICTION_OK_OR_SAY(stiction_stepping_solver_destroy(solver));
}

/// A solver of Jacobians: a handle of the same kind, made for another form.
TEST(CSameSteps, OfJacobians) {
  JacobianBatch<double> batch(Law::coulomb);
  for (std::uint64_t seed = 1; seed <= 3; ++seed) batch.add(random_jacobian({seed}));
  std::vector<std::uint64_t> cone_id;
  for (std::uint64_t cone = 0; cone < static_cast<std::uint64_t>(batch.view().cone_count); ++cone)
    cone_id.push_back(500 - cone);
  JacobianSteppingSolver<double> stepper(Device::cpu(), SolverOptions{}, JacobianCapacity::of(batch.view()));
  const stiction_jacobian_view view = c_view(batch.view());
  stiction_jacobian_capacity capacity;
  stiction_jacobian_capacity_init(&capacity, sizeof capacity);
  STICTION_OK_OR_SAY(stiction_jacobian_capacity_of(&view, &capacity));
  stiction_stepping_solver* solver = nullptr;
  STICTION_OK_OR_SAY(stiction_stepping_solver_create_jacobian("cpu", nullptr, &capacity, nullptr, &solver));
  for (const double dt : {0.01, 0.02}) {
    Solution<double> expected = room_for<double>(batch.row_count(), batch.env_count());
    Solution<double> found = expected;
    std::vector<double> moved(static_cast<std::size_t>(batch.dof_count())), velocity(moved);
    stepper.solve(batch.view(), cone_id.data(), dt,
                  {expected.lambda.data(), expected.w.data(), moved.data(), expected.status.data()});
    stiction_jacobian_solution answer;
    stiction_jacobian_solution_init(&answer, sizeof answer);
    answer.lambda = found.lambda.data();
    answer.w = found.w.data();
    answer.velocity = velocity.data();
    answer.status = records(found.status);
    STICTION_OK_OR_SAY(stiction_stepping_solver_solve_jacobian(solver, &view, cone_id.data(), dt, &answer, nullptr));
    EXPECT_TRUE(same_bits(expected, found));
    EXPECT_TRUE(same_bits(std::span<const double>(moved), std::span<const double>(velocity)));
  }
  const stiction_batch_view other = c_view(contacts().view());
  stiction_solution nowhere;
  stiction_solution_init(&nowhere, sizeof nowhere);
  EXPECT_EQ(stiction_stepping_solver_solve(solver, &other, cone_id.data(), 0.01, &nowhere, nullptr),
            STICTION_INVALID_ARGUMENT);
  EXPECT_NE(std::string(stiction_last_error()).find("another form"), std::string::npos);
  STICTION_OK_OR_SAY(stiction_stepping_solver_destroy(solver));
}

TEST(CSameSteps, OfBodies) {
  TimeStepping stepping;
  stepping.dt = 0.01;
  const BodyBatch<double> batch = thrown_bodies(3, 0);
  BodyBatchView<double> named = batch.view();
  std::vector<std::uint64_t> contact_id;
  for (std::uint64_t c = 0; c < static_cast<std::uint64_t>(batch.contact_count()); ++c) contact_id.push_back(c * c);
  named.contact_id = contact_id.data();
  BodySteppingSolver<double> stepper(Device::cpu(), stepping, {}, batch.env_count(), batch.contact_count());
  stiction_time_stepping step;
  stiction_time_stepping_init(&step, sizeof step);
  step.dt = 0.01;
  stiction_capacity capacity;
  stiction_capacity_init(&capacity, sizeof capacity);
  capacity.envs = batch.env_count();
  capacity.cones = batch.contact_count();
  capacity.precision = STICTION_F64;
  stiction_stepping_solver* solver = nullptr;
  STICTION_OK_OR_SAY(stiction_stepping_solver_create_bodies("cpu", &step, nullptr, &capacity, nullptr, &solver));
  const stiction_body_view view = c_view(batch.view());
  for (int k = 0; k < 2; ++k) {
    Solution<double> expected = room_for<double>(3 * batch.contact_count(), batch.env_count());
    Solution<double> found = expected;
    std::vector<double> moved(static_cast<std::size_t>(6 * batch.body_count())), twist(moved);
    stepper.solve(named, {expected.lambda.data(), moved.data(), expected.w.data(), expected.status.data()});
    stiction_body_solution answer;
    stiction_body_solution_init(&answer, sizeof answer);
    answer.impulse = found.lambda.data();
    answer.twist = twist.data();
    answer.w = found.w.data();
    answer.status = records(found.status);
    STICTION_OK_OR_SAY(stiction_stepping_solver_solve_bodies(solver, &view, contact_id.data(), &answer, nullptr));
    EXPECT_TRUE(same_bits(expected, found));
    EXPECT_TRUE(same_bits(std::span<const double>(moved), std::span<const double>(twist)));
  }
  std::vector<stiction_warm_start_record> records(static_cast<std::size_t>(batch.env_count()));
  STICTION_OK_OR_SAY(stiction_stepping_solver_records(solver, records.data(), batch.env_count(), nullptr));
  for (const auto& record : records) EXPECT_EQ(record.hits, 12);
  STICTION_OK_OR_SAY(stiction_stepping_solver_reset_all(solver, nullptr));
  STICTION_OK_OR_SAY(stiction_stepping_solver_synchronize(solver, nullptr));
  STICTION_OK_OR_SAY(stiction_stepping_solver_destroy(solver));
}

}  // namespace
