#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <vector>

#include "core/runtime/articulated/varied_arrays.hpp"
#include "stiction/articulated.hpp"
#include "stiction/hash.hpp"
#include "tests/support/error_message.hpp"
#include "tests/support/machines/same_on_all_kernels.hpp"
#include "tests/support/systems/walker_states.hpp"

/// Robots with constants of their own.
namespace {

using namespace stiction;
using namespace stiction::test;

constexpr std::array kAll{VariedArray::body_mass,     VariedArray::body_inertia,     VariedArray::pair_friction,
                          VariedArray::actuator_gain, VariedArray::actuator_bias,    VariedArray::dof_damping,
                          VariedArray::dof_armature,  VariedArray::dof_friction_loss};

/// A walker whose box holds a part of its weight, with constants that differ from robot to robot.
ArticulatedDescription changed_walker(bool is_elliptic, bool is_rk4, Offset env) {
  ArticulatedDescription model = walker(is_elliptic, is_rk4);
  model.impratio = 3;
  model.bodies[1].gravity_compensation = 0.3;
  std::uint64_t seed = 70 * static_cast<std::uint64_t>(env);
  const auto change = [&](double& number) { number *= env == 0 ? 1 : 1 + 0.4 * stiction::test::number(seed++); };
  for (ArticulatedBody& body : model.bodies) {
    const double before = body.mass;
    change(body.mass);
    for (double& moment : body.inertia) moment *= before == 0 ? 1 : body.mass / before;
  }
  for (ArticulatedPair& pair : model.pairs)
    for (double& mu : pair.friction) change(mu);
  for (ArticulatedActuator& actuator : model.actuators) {
    for (double& part : actuator.gain) change(part);
    for (double& part : actuator.bias) change(part);
  }
  for (ArticulatedDof& dof : model.dofs) {
    change(dof.damping);
    change(dof.armature);
    change(dof.friction_loss);
  }
  return model;
}

/// Gives an environment the constants of a description.
template <class Real>
void put_constants(ArticulatedBatch<Real>& robots, std::size_t env, const ArticulatedDescription& from) {
  for (const VariedArray which : kAll) {
    const std::vector<double> row = constants_of(from, which);
    for (std::size_t k = 0; k < row.size(); ++k) robots.varied(which)[env * row.size() + k] = static_cast<Real>(row[k]);
  }
}

template <class Real>
ArticulatedBatch<Real> varied_robots(bool is_elliptic, bool is_rk4, const std::vector<Offset>& envs, int threads = 1) {
  ArticulatedBatch<Real> robots(changed_walker(is_elliptic, is_rk4, 0), static_cast<Offset>(envs.size()),
                                {1e-5, 100, threads, true, {kAll.begin(), kAll.end()}});
  put_states(robots, envs);
  for (std::size_t e = 0; e < envs.size(); ++e) put_constants(robots, e, changed_walker(is_elliptic, is_rk4, envs[e]));
  return robots;
}

template <class Real>
std::uint64_t hash_after(bool is_elliptic, bool is_rk4, int threads) {
  ArticulatedBatch<Real> robots = varied_robots<Real>(is_elliptic, is_rk4, all_envs(), threads);
  robots.step(12);
  return robots.hash();
}

TEST(ArticulatedConstants, NoInstructionSetAndNoThreadChangesABit) {
  for (const bool is_elliptic : {false, true})
    for (const bool is_rk4 : {false, true}) {
      expect_same_on_all_kernels(
          [&](auto real, int threads) { return hash_after<decltype(real)>(is_elliptic, is_rk4, threads); });
    }
}

/// Each environment has the bits of a batch whose description has its constants. It separates every number that
/// follows from a constant, and every constant of a neighbour, from the right one.
TEST(ArticulatedConstants, ARobotIsTheOneThatADescriptionWouldMake) {
  for (const bool is_elliptic : {false, true})
    for (const bool is_rk4 : {false, true}) {
      ArticulatedBatch<double> robots = varied_robots<double>(is_elliptic, is_rk4, all_envs());
      robots.step(12);
      const auto nq = static_cast<std::size_t>(robots.q_count());
      for (const Offset env : all_envs()) {
        ArticulatedBatch<double> alone(changed_walker(is_elliptic, is_rk4, env), 1, {1e-5, 100, 1, true});
        put_states(alone, {env});
        alone.step(12);
        const auto place = static_cast<std::size_t>(env);
        for (std::size_t k = 0; k < nq; ++k) EXPECT_EQ(robots.qpos()[place * nq + k], alone.qpos()[k]) << env;
        for (const ObservedArray which : {ObservedArray::cinert, ObservedArray::cvel, ObservedArray::cfrc_ext}) {
          const auto width = static_cast<std::size_t>(robots.observed_width(which));
          for (std::size_t k = 0; k < width; ++k)
            EXPECT_EQ(robots.observed(which)[place * width + k], alone.observed(which)[k]) << env << " " << k;
        }
      }
    }
}

/// Moments of a body in any order, also equal ones: M is that of a description to roundings.
TEST(ArticulatedConstants, PrincipalMomentsMayHaveAnyOrder) {
  const std::array<double, 3> moments[] = {
      {.03, .05, .04}, {.04, .03, .05}, {.05, .04, .02}, {.04, .04, .04}, {0, .02, .02}};
  ArticulatedDescription model = walker(false);
  model.bodies[1].inertia = {.04, .04, .04};
  model.bodies[1].inertia_axes = {.5, .5, -.5, .5};
  ArticulatedBatch<double> robots(model, 5, {1e-6, 100, 1, false, {VariedArray::body_inertia}});
  const auto width = static_cast<std::size_t>(robots.varied_width(VariedArray::body_inertia));
  for (std::size_t env = 0; env < 5; ++env)
    for (std::size_t k = 0; k < 3; ++k) robots.varied(VariedArray::body_inertia)[env * width + 3 + k] = moments[env][k];
  const ArticulatedProbe found = robots.probe();
  for (std::size_t env = 0; env < 5; ++env) {
    model.bodies[1].inertia = moments[env];
    const ArticulatedProbe expected = ArticulatedBatch<double>(model, 1).probe();
    for (std::size_t k = 0; k < expected.M.size(); ++k)
      EXPECT_NEAR(found.M[env * expected.M.size() + k], expected.M[k], 1e-14) << env;
  }
}

/// A constant out of range stops its own robot, and the others have the bits that they would have had.
TEST(ArticulatedConstants, NumbersOutOfRangeStayAlone) {
  const double nan = std::nan(""), infinite = std::numeric_limits<double>::infinity();
  ArticulatedBatch<double> expected = varied_robots<double>(true, false, all_envs());
  const std::vector<double> before(expected.qpos().begin(), expected.qpos().end());
  expected.step(5);
  const auto nq = static_cast<std::size_t>(expected.q_count());
  for (const VariedArray which : kAll)
    for (const double number : {nan, infinite, -1.0}) {
      const bool has_sign = which == VariedArray::actuator_gain || which == VariedArray::actuator_bias;
      if (has_sign && number == -1.0) continue;
      ArticulatedBatch<double> robots = varied_robots<double>(true, false, all_envs());
      const auto width = static_cast<std::size_t>(robots.varied_width(which));
      robots.varied(which)[6 * width - 1] = number;
      robots.step(5);
      EXPECT_EQ(robots.status()[5].code, EnvCode::invalid_input);
      EXPECT_NE(robots.status()[5].flags, 0U);
      for (std::size_t k = 0; k < before.size(); ++k)
        EXPECT_EQ(robots.qpos()[k], k / nq == 5 ? before[k] : expected.qpos()[k]) << k;
    }
}

TEST(ArticulatedConstants, ARobotWithoutMassIsToldApart) {
  ArticulatedBatch<double> robots = varied_robots<double>(false, false, {0, 1, 2});
  for (const VariedArray which : {VariedArray::body_mass, VariedArray::body_inertia, VariedArray::dof_armature}) {
    const auto width = static_cast<std::size_t>(robots.varied_width(which));
    for (double& number : robots.varied(which).subspan(width, width)) number = 0;
  }
  robots.step();
  EXPECT_EQ(robots.status()[1].code, EnvCode::invalid_input);
  EXPECT_NE(robots.status()[1].flags & kFlagBadMass, 0U);
  for (const std::size_t env : {0U, 2U}) EXPECT_EQ(robots.status()[env].code, EnvCode::solved);
}

/// Dry friction that a robot does not have makes no row for it.
TEST(ArticulatedConstants, RowsOfDryFrictionComeWithIt) {
  ArticulatedDescription model = walker(false);
  model.pairs.clear();
  model.equalities.clear();
  for (ArticulatedJoint& joint : model.joints) joint.is_limited = false;
  ArticulatedBatch<double> robots(model, 3, {1e-6, 100, 1, false, {VariedArray::dof_friction_loss}});
  const auto width = static_cast<std::size_t>(robots.dof_count());
  for (double& number : robots.varied(VariedArray::dof_friction_loss).subspan(width, width)) number = 0;
  robots.varied(VariedArray::dof_friction_loss)[2 * width + 7] = 0.1;
  const ArticulatedProbe found = robots.probe();
  EXPECT_EQ(found.rows, (std::vector<std::int32_t>{2, 0, 3}));
  robots.qvel()[width + 7] = robots.qvel()[2 * width + 7] = 1;
  robots.step(3);
  EXPECT_GT(robots.qvel()[width + 7], robots.qvel()[2 * width + 7]);
}

TEST(ArticulatedConstants, NothingVariesThatWasNotAskedFor) {
  ArticulatedBatch<double> robots(walker(true), 2, {1e-6, 100, 1, false, {VariedArray::body_mass}});
  EXPECT_EQ(robots.varied(VariedArray::body_mass).size(), 12U);
  EXPECT_EQ(robots.varied(VariedArray::body_mass)[7], 4);
  EXPECT_TRUE(robots.varied(VariedArray::dof_damping).empty());
  EXPECT_EQ(robots.varied_width(VariedArray::pair_friction), 20);
  const auto made = [] { ArticulatedBatch<float>(walker(true), 1, {1e-5, 100, 0, false, {VariedArray{8}}}); };
  EXPECT_NE(error_message(made).find("varies holds 8"), std::string::npos);
}

}  // namespace
