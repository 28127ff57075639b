#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>

#include "stiction/jacobian_bodies.hpp"
#include "stiction/residual.hpp"
#include "tests/support/error_message.hpp"
#include "tests/support/systems/box_jacobians.hpp"
#include "tests/support/systems/roomy_jacobians.hpp"
#include "tests/support/systems/velocity_cases.hpp"

/// Rigid bodies found in J and M, solved by the solvers of bodies and judged by A.
namespace {

using namespace stiction;
using namespace stiction::test;

using Env = JacobianEnvironment<double>;

/// Boxes with one R on all rows, and targets of either sign on normal rows.
Env boxes(const scenes::BoxScene& scene, double R = 0.0) {
  Env env = boxes_as_jacobian(scene, {.push = 1.0});
  env.R.assign(env.mu.size(), R);
  env.target.assign(env.mu.size(), 0.0);
  for (std::size_t row = 0; row < env.target.size(); row += 3)
    env.target[row] = 1e-3 * std::sin(static_cast<double>(row));
  return env;
}

/// The tangential rows of every cone turned by an angle, and every other cone's frame mirrored.
Env turned(Env env) {
  Env to = env;
  to.row_offsets = {0};
  to.J.clear();
  to.column.clear();
  for (std::size_t cone = 0; cone < env.cones.size(); ++cone) {
    const double angle = 0.3 + static_cast<double>(cone), c = std::cos(angle), s = std::sin(angle);
    const double mirror = cone % 2 == 0 ? 1.0 : -1.0;
    const double weights[3][3] = {{1, 0, 0}, {0, c, s}, {0, -s * mirror, c * mirror}};
    for (const auto& weight : weights) {
      for (std::size_t k = 0; k < 3; ++k) {
        if (weight[k] == 0.0) continue;
        const auto first = static_cast<std::size_t>(env.row_offsets[3 * cone + k]);
        const auto end = static_cast<std::size_t>(env.row_offsets[3 * cone + k + 1]);
        for (std::size_t e = first; e < end; ++e) {
          to.J.push_back(weight[k] * env.J[e]);
          to.column.push_back(env.column[e]);
        }
      }
      to.row_offsets.push_back(static_cast<Index>(to.J.size()));
    }
  }
  return to;
}

JacobianBatch<double> batch_of(const std::vector<Env>& envs, Law law = Law::convex, Index block = 6,
                               MassForm form = MassForm::matrix) {
  JacobianBatch<double> batch(law, form, block);
  for (Env env : envs) {
    if (block == 0) env.M = full_mass(env, 6);
    batch.add(in_form(env, form, block));
  }
  return batch;
}

void expect_solved(const JacobianBatch<double>& batch, Law law, BodySolverOptions options, double tolerance) {
  const JacobianBodies<double> bodies = as_bodies(batch.view());
  options.law = law;
  options.tolerance = tolerance;
  options.iterations = options.method == BodyMethod::newton ? 200 : 20000;
  const auto solution = solve_bodies(bodies.batch, bodies.stepping, options);
  const std::vector<double> lambda = to_rows(bodies, std::span<const double>(solution.impulse));
  const auto judged = verify(assemble(batch.view()).view(), std::span<const double>(lambda));
  for (std::size_t e = 0; e < judged.size(); ++e) {
    EXPECT_EQ(solution.status[e].code, EnvCode::solved);
    // The largest |b| that residuals are relative to depends on the axes of a contact.
    EXPECT_LE(judged[e].relative, 1.42 * tolerance);
    EXPECT_LE(std::abs(judged[e].relative - solution.status[e].residual), 0.42 * solution.status[e].residual);
  }
}

BodySolverOptions by(BodyMethod method) {
  BodySolverOptions options;
  options.method = method;
  return options;
}

TEST(JacobianBodies, EveryMethodOfBodiesSolvesThem) {
  const auto batch = batch_of({turned(boxes(scenes::box_wall(4, 4), 1e-3)), boxes(scenes::box_tower(5), 1e-3)});
  expect_solved(batch, Law::convex, by(BodyMethod::impulses), 1e-5);
  for (int k = 0; k < kBodyPreconditionerCount; ++k) {
    BodySolverOptions options = by(BodyMethod::newton);
    options.space.preconditioner = static_cast<BodyPreconditioner>(k);
    SCOPED_TRACE(to_string(options.space.preconditioner));
    expect_solved(batch, Law::convex, options, 1e-8);
  }
}

TEST(JacobianBodies, EveryFormIsTaken) {
  const Env env = turned(boxes(scenes::box_pyramid(3)));
  for (const MassForm form : {MassForm::matrix, MassForm::factor})
    for (const Index block : {6, 0})
      expect_solved(batch_of({env}, Law::coulomb, block, form), Law::coulomb, by(BodyMethod::newton), 1e-6);
}

TEST(JacobianBodies, RowsAndContactsAreEachOthersInverse) {
  const auto batch = batch_of({turned(boxes(scenes::box_tower(3)))});
  const JacobianBodies<double> bodies = as_bodies(batch.view());
  std::vector<double> numbers(static_cast<std::size_t>(batch.row_count()));
  for (std::size_t i = 0; i < numbers.size(); ++i) numbers[i] = std::sin(static_cast<double>(i));
  const auto back = to_contacts(bodies, std::span<const double>(to_rows(bodies, std::span<const double>(numbers))));
  for (std::size_t i = 0; i < numbers.size(); ++i) EXPECT_NEAR(back[i], numbers[i], 1e-15);
  numbers.pop_back();
  EXPECT_NE(error_message([&] { (void)to_rows(bodies, std::span<const double>(numbers)); }).find("by_contact"),
            std::string::npos);
}

/// Arrays that are no body are named, with their place.
TEST(JacobianBodies, OtherThingsAreNamed) {
  const auto message = [](const std::function<void(Env&)>& change) {
    Env env = boxes(scenes::box_tower(3));
    change(env);
    return error_message([&] { (void)as_bodies(batch_of({boxes(scenes::box_tower(2)), env}).view()); });
  };
  const std::vector<std::pair<const char*, std::function<void(Env&)>>> cases = {
      {"environment 1: body 0 has different masses", [](Env& env) { env.M[7] = 2.0; }},
      {"environment 1: body 1 couples velocity and spin", [](Env& env) { env.M[36 + 18] = 0.1; }},
      {"environment 1: body 2 has no positive mass", [](Env& env) { env.M[72] = 0.0; }},
      {"environment 1: cone 1 has another R", [](Env& env) { env.R[4] = 0.5; }},
      {"environment 1: cone 2 has two frictions", [](Env& env) { env.mu[7] = 0.25; }},
      {"environment 1: cone 3 has a tangential target", [](Env& env) { env.target[10] = 0.5; }},
      {"environment 1: cone 0 has rows that are no orthogonal axes", [](Env& env) { env.J[0] = 2.0; }},
      {"environment 1: cone 0 is no point of body 0", [](Env& env) { env.J[1] += 0.5; }},
      {"environment 1: cone 0 is no friction cone",
       [](Env& env) {
         env.cones[0] = friction(2);
         env.cones[1] = friction(4);
       }},
  };
  for (const auto& [expected, change] : cases)
    EXPECT_NE(message(change).find(expected), std::string::npos) << message(change);
}

}  // namespace
