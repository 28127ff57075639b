// Changes that a caller may make to its own arrays between a plan and a solve, or one array given twice.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "stiction/batch_arrays.hpp"
#include "stiction/bodies.hpp"
#include "stiction/jacobian_solver.hpp"
#include "tests/support/error_message.hpp"
#include "tests/support/systems/body_systems.hpp"
#include "tests/support/systems/scene_batches.hpp"
#include "tests/support/systems/small_systems.hpp"

namespace stiction::test {
namespace {

using testing::HasSubstr;

constexpr Offset kFar = 1'000'000'000;

/// A planned batch whose arrays the test may write to afterwards.
class Edited : public testing::TestWithParam<Device> {
 protected:
  Edited() { arrays = scene_batch("walker", 6, 3).arrays(); }

  [[nodiscard]] ContactBatchView<double> view() const {
    ContactBatchView<double> view;
    view.env_count = static_cast<Offset>(arrays.env_row_offsets.size()) - 1;
    view.cone_count = static_cast<Offset>(arrays.cone_kind.size());
    view.row_count = static_cast<Offset>(arrays.b.size());
    view.nonzero_count = static_cast<Offset>(arrays.A.size());
    for_each_held_array(view, PointAt{}, view, arrays);
    return view;
  }

  Solution<double> solve_planned(const Solver& solver, const Plan& plan) {
    Solution<double> solution;
    solution.lambda.assign(arrays.b.size(), 77);
    solution.w.assign(arrays.b.size(), 77);
    solution.status.resize(arrays.env_row_offsets.size() - 1);
    solver.solve(plan, view(), {solution.lambda.data(), solution.w.data(), solution.status.data()});
    return solution;
  }

  static SolverOptions asked(InvalidPolicy policy) {
    SolverOptions o = options(SolverKind::npgs, 1e-6, 200);
    o.invalid = policy;
    return o;
  }

  ContactBatch<double>::Arrays arrays;
};

TEST_P(Edited, OffsetsOutOfOrderAreNamedAndNothingIsReadThroughThem) {
  const auto sound = arrays;
  for (const InvalidPolicy policy : {InvalidPolicy::reject, InvalidPolicy::isolate}) {
    const Solver solver(GetParam(), asked(policy));
    const Plan plan = solver.plan(view());
    const auto refused = [&](auto& array, std::size_t at, auto value, const char* name) {
      array[at] = value;
      EXPECT_THAT(error_message([&] { solve_planned(solver, plan); }), HasSubstr(name));
      arrays = sound;
    };
    for (const Offset value : {Offset{5}, kFar, Offset{-1}, std::numeric_limits<Offset>::min()}) {
      const Offset middle = value == 5 ? arrays.env_row_offsets.back() + 1 : value;
      refused(arrays.env_row_offsets, 1, middle, "env_row_offsets[");
      refused(arrays.env_cone_offsets, 2, middle, "env_cone_offsets[");
      refused(arrays.cone_row_offsets, 3, middle, "cone_row_offsets[");
      refused(arrays.row_offsets, 7, value == 5 ? arrays.row_offsets.back() + 1 : value, "row_offsets[");
    }
    refused(arrays.cone_kind, 0, static_cast<ConeKind>(9), "cone_kind[env 0, cone 0] = 9");
    refused(arrays.cone_row_offsets, 0, Offset{1}, "cone_row_offsets[0] = 1");
  }
}

TEST_P(Edited, OffsetsInOrderOfOtherEnvironmentsNeedAnotherPlan) {
  const Solver solver(GetParam(), asked(InvalidPolicy::isolate));
  const Plan plan = solver.plan(view());
  // One cone of the second environment becomes the first one's, all arrays consistent.
  const Offset cone = arrays.env_cone_offsets[1];
  arrays.env_cone_offsets[1] = cone + 1;
  arrays.env_row_offsets[1] = arrays.cone_row_offsets[static_cast<std::size_t>(cone) + 1];
  const std::string said = error_message([&] { solve_planned(solver, plan); });
  EXPECT_TRUE(said.find("make a new plan") != std::string::npos || said.find("column[env") != std::string::npos)
      << said;
}

TEST_P(Edited, AColumnOutOfRangeThrowsOrStaysInItsEnvironment) {
  const std::size_t first =
      static_cast<std::size_t>(arrays.row_offsets[static_cast<std::size_t>(arrays.env_row_offsets[2])]);
  const Solver isolating(GetParam(), asked(InvalidPolicy::isolate)),
      rejecting(GetParam(), asked(InvalidPolicy::reject));
  const Plan plan = isolating.plan(view());
  const Solution<double> whole = solve_planned(isolating, plan);
  const auto sound = arrays.column;
  for (const Index column : {Index{1'000'000'000}, Index{-1}, std::numeric_limits<Index>::min(),
                             static_cast<Index>(arrays.env_row_offsets[3] - arrays.env_row_offsets[2])}) {
    SCOPED_TRACE(column);
    arrays.column[first] = column;
    EXPECT_THAT(error_message([&] { solve_planned(rejecting, rejecting.plan(view())); }),
                HasSubstr("column[env 2, row 0]"));
    EXPECT_THAT(error_message([&] { solve_planned(rejecting, plan); }), HasSubstr("column[env 2, row 0]"));
    const Solution<double> answer = solve_planned(isolating, plan);
    for (std::size_t env = 0; env < answer.status.size(); ++env) {
      const auto row = static_cast<std::size_t>(arrays.env_row_offsets[env]);
      const auto end = static_cast<std::size_t>(arrays.env_row_offsets[env + 1]);
      if (env == 2) {
        EXPECT_EQ(answer.status[env].code, EnvCode::invalid_input);
        EXPECT_NE(answer.status[env].flags & kFlagBadStructure, 0U);
        for (std::size_t i = row; i < end; ++i) EXPECT_EQ(answer.lambda[i], 0) << i;
        continue;
      }
      EXPECT_EQ(answer.status[env].code, whole.status[env].code);
      for (std::size_t i = row; i < end; ++i) EXPECT_EQ(answer.lambda[i], whole.lambda[i]) << i;
    }
    arrays.column = sound;
  }
}

TEST_P(Edited, AnOutputThatSharesMemoryIsRefusedByName) {
  const Solver solver(GetParam(), asked(InvalidPolicy::isolate));
  const Plan plan = solver.plan(view());
  std::vector<double> lambda(arrays.b.size()), w(arrays.b.size());
  std::vector<EnvStatus> status(arrays.env_row_offsets.size() - 1);
  const auto before = arrays.b;
  const auto refused = [&](const SolutionView<double>& out, const double* warm_start, const char* one,
                           const char* other) {
    for (const auto& said : {error_message([&] { solver.solve(plan, view(), out, warm_start); }),
                             error_message([&] { solver.solve(view(), out, warm_start); })}) {
      EXPECT_THAT(said, HasSubstr(std::string(one) + " and " + other + " overlap"));
    }
  };
  refused({arrays.b.data(), w.data(), status.data()}, nullptr, "solution.lambda", "batch.b");
  refused({lambda.data(), arrays.A.data() + 1, status.data()}, nullptr, "solution.w", "batch.A");
  refused({lambda.data(), lambda.data(), status.data()}, nullptr, "solution.w", "solution.lambda");
  refused({lambda.data(), lambda.data() + lambda.size() - 1, status.data()}, nullptr, "solution.w", "solution.lambda");
  refused({lambda.data(), w.data(), reinterpret_cast<EnvStatus*>(w.data())}, nullptr, "solution.status", "solution.w");
  refused({lambda.data(), w.data(), status.data()}, w.data(), "solution.w", "warm_start");
  refused({lambda.data(), nullptr, status.data()}, lambda.data() + 1, "solution.lambda", "warm_start");
  EXPECT_EQ(arrays.b, before) << "nothing was written";

  // Arrays that touch end to end share nothing, and a step may start from the reactions that it replaces.
  std::vector<double> both(2 * lambda.size(), 0.25);
  const std::vector<double> guess(lambda.size(), 0.25);
  solver.solve(plan, view(), {lambda.data(), w.data(), status.data()}, guess.data());
  solver.solve(plan, view(), {both.data(), both.data() + lambda.size(), status.data()}, both.data());
  EXPECT_TRUE(std::equal(lambda.begin(), lambda.end(), both.begin()));
}

INSTANTIATE_TEST_SUITE_P(Devices, Edited, testing::Values(Device::cpu(), Device::emulated()),
                         [](const auto& device) { return device.param.kind == DeviceKind::cpu ? "cpu" : "emulated"; });

class EditedBodies : public testing::Test {
 protected:
  BodyBatch<double> batch = batch_of<double>({random_bodies(1, 3, 5), random_bodies(2, 4, 9)});
  std::vector<double> impulse = std::vector<double>(3 * 14), twist = std::vector<double>(6 * 7), w = impulse;
  std::vector<EnvStatus> status = std::vector<EnvStatus>(2);
  BodySolutionView<double> out{impulse.data(), twist.data(), w.data(), status.data()};
};

TEST_F(EditedBodies, BodyNumbersAndOffsetsAreLookedAtAgain) {
  for (const InvalidPolicy policy : {InvalidPolicy::reject, InvalidPolicy::isolate}) {
    BodySolverOptions o;
    o.invalid = policy;
    const BodySolver solver(Device::cpu(), {}, o);
    BodyBatchView<double> view = batch.view();
    const BodyPlan plan = solver.plan(view);
    std::vector<Index> body_b(view.body_b, view.body_b + view.contact_count);
    std::vector<Offset> contacts(view.env_contact_offsets, view.env_contact_offsets + 3);
    view.body_b = body_b.data();
    view.env_contact_offsets = contacts.data();
    const Index kept = body_b[6];
    for (const Index number : {Index{1'000'000'000}, Index{-7}}) {
      body_b[6] = number;
      EXPECT_THAT(error_message([&] { solver.solve(plan, view, out); }), HasSubstr("body_b[env 1, contact 1] = "));
    }
    body_b[6] = kept;
    for (const Offset number : {kFar, Offset{-3}}) {
      contacts[1] = number;
      EXPECT_THAT(error_message([&] { solver.solve(plan, view, out); }), HasSubstr("env_contact_offsets["));
    }
    contacts[1] = 5;
    solver.solve(plan, view, out);
  }
}

TEST_F(EditedBodies, AnOutputThatSharesMemoryIsRefusedByName) {
  const BodySolver solver(Device::cpu(), {}, {});
  const BodyBatchView<double> view = batch.view();
  const BodyPlan plan = solver.plan(view);
  const auto refused = [&](const BodySolutionView<double>& to, const double* warm_start, const char* both) {
    EXPECT_THAT(error_message([&] { solver.solve(plan, view, to, warm_start); }), HasSubstr(both));
    EXPECT_THAT(error_message([&] { solver.solve(view, to, warm_start); }), HasSubstr(both));
  };
  refused({impulse.data(), const_cast<double*>(view.twist), nullptr, status.data()}, nullptr,
          "solution.twist and batch.twist overlap");
  refused({impulse.data(), twist.data(), impulse.data(), status.data()}, nullptr,
          "solution.w and solution.impulse overlap");
  refused({impulse.data(), twist.data(), w.data(), status.data()}, twist.data(),
          "solution.twist and warm_start overlap");
  solver.solve(plan, view, out, impulse.data());
}

TEST(EditedJacobians, AnOutputThatSharesMemoryIsRefusedByName) {
  JacobianBatch<double> batch;
  JacobianEnvironment<double> env;
  env.cones = {{ConeKind::unilateral, 1}};
  env.J = {1};
  env.M = {2};
  env.v_free = {-3};
  batch.add(env);
  const JacobianBatchView<double> view = batch.view();
  JacobianSolver<double> solver(Device::cpu(), options(SolverKind::npgs, 1e-9, 50), {});
  double lambda = 0, w = 0, velocity = 0;
  EnvStatus status{};
  EXPECT_THAT(error_message([&] { solver.solve(view, {&lambda, &w, const_cast<double*>(view.v_free), &status}); }),
              HasSubstr("solution.velocity and batch.v_free overlap"));
  EXPECT_THAT(error_message([&] { solver.solve(view, {&lambda, &lambda, &velocity, &status}); }),
              HasSubstr("solution.w and solution.lambda overlap"));
  EXPECT_THAT(error_message([&] { solver.solve(view, {&lambda, &w, &velocity, &status}, &velocity); }),
              HasSubstr("solution.velocity and warm_start overlap"));
  solver.solve(view, {&lambda, &w, &velocity, &status}, &lambda);
  EXPECT_NEAR(velocity, 0, 1e-8);
}

/// Shortest and longest array of a view's list.
template <class View>
std::pair<Offset, Offset> lengths(const View& view) {
  std::pair<Offset, Offset> range{std::numeric_limits<Offset>::max(), std::numeric_limits<Offset>::min()};
  for_each_array(
      view,
      [&range](const BatchArray& array, const auto*) {
        range = {std::min(range.first, array.length), std::max(range.second, array.length)};
      },
      view);
  return range;
}

// Lists are walked before counts are checked: a length is no overflow, whatever a caller wrote.
TEST(EditedCounts, LengthsOfArraysDoNotOverflow) {
  for (const Offset count : {std::numeric_limits<Offset>::max(), std::numeric_limits<Offset>::min(), Offset{-1}}) {
    BodyBatchView<float> bodies;
    bodies.env_count = bodies.body_count = bodies.contact_count = count;
    ContactBatchView<float> contacts;
    contacts.env_count = contacts.cone_count = contacts.row_count = count;
    JacobianBatchView<float> jacobians;
    jacobians.env_count = jacobians.cone_count = jacobians.row_count = count;
    for (const auto& [shortest, longest] : {lengths(bodies), lengths(contacts), lengths(jacobians)}) {
      EXPECT_GE(shortest, 0) << count;
      EXPECT_LE(longest, std::numeric_limits<Offset>::max() / 8) << count;
    }
  }
}

}  // namespace
}  // namespace stiction::test
