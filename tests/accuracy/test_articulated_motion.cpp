#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "stiction/articulated.hpp"
#include "tests/support/error_message.hpp"
#include "tests/support/systems/walker.hpp"

/// Motions that are known in closed form, and models at the edge of the supported ones.
namespace {

using namespace stiction;
using namespace stiction::test;

constexpr double kGravity = 9.81;

ArticulatedDescription world_of(double timestep, bool is_rk4) {
  ArticulatedDescription model;
  model.timestep = timestep;
  model.is_rk4 = is_rk4;
  model.bodies.push_back({});
  return model;
}

/// Adds a body of 2 kg, 0.4 m below the joint that hangs it on another.
void hang(ArticulatedDescription& model, Index parent) {
  ArticulatedBody body;
  body.parent = parent;
  body.joints = 1;
  body.position = {0, 0, parent == 0 ? 0 : -0.5};
  body.mass = 2;
  body.centre = {0, 0, -0.4};
  body.inertia = {0.03, 0.02, 0.01};
  body.inverse_weight = {1, 1};
  model.bodies.push_back(body);
  ArticulatedJoint joint;
  joint.axis = {0, 1, 0};
  model.joints.push_back(joint);
  model.dofs.push_back({0, 0, 0, {}, 1});
}

/// Complete elliptic integral of the first kind, by the arithmetic and geometric mean (Abramowitz and Stegun, 17.6).
double elliptic_k(double modulus) {
  double a = 1, b = std::sqrt(1 - modulus * modulus);
  for (int k = 0; k < 8; ++k) {
    const double mean = (a + b) / 2;
    b = std::sqrt(a * b);
    a = mean;
  }
  return std::numbers::pi / (2 * a);
}

/// Distance of a pendulum of large swings from its start after one period.
double miss_of_pendulum(Index steps) {
  constexpr double kStart = 2.0, kMoment = 0.02 + 2 * 0.4 * 0.4;
  const double period = 4 * std::sqrt(kMoment / (2 * kGravity * 0.4)) * elliptic_k(std::sin(kStart / 2));
  ArticulatedDescription model = world_of(period / steps, true);
  hang(model, 0);
  ArticulatedBatch<double> robots(model, 2);
  robots.qpos()[0] = kStart;
  robots.qpos()[1] = -kStart;
  robots.step(steps);
  EXPECT_EQ(robots.qpos()[0], -robots.qpos()[1]);
  return std::fabs(robots.qpos()[0] - kStart) + period * std::fabs(robots.qvel()[0]);
}

TEST(ArticulatedMotion, APendulumHasItsPeriod) {
  const double whole = miss_of_pendulum(200), half = miss_of_pendulum(400);
  EXPECT_LT(whole, 1e-5);
  EXPECT_LT(half, whole / 12) << whole;
  EXPECT_LT(miss_of_pendulum(3000), 1e-9);
}

/// Energy of two bodies that `hang` has made, one below the other.
double energy_of(ArticulatedBatch<double>& robots) {
  const auto q = robots.qpos(), v = robots.qvel();
  const double first = q[0], second = q[0] + q[1], spin = v[0] + v[1];
  const double x = -0.5 * std::cos(first) * v[0] - 0.4 * std::cos(second) * spin;
  const double z = 0.5 * std::sin(first) * v[0] + 0.4 * std::sin(second) * spin;
  const double motion = 0.5 * ((0.02 + 2 * 0.16) * v[0] * v[0] + 0.02 * spin * spin + 2 * (x * x + z * z));
  return motion - 2 * kGravity * (0.4 * std::cos(first) + 0.5 * std::cos(first) + 0.4 * std::cos(second));
}

/// Change of energy of a double pendulum in two seconds.
double lost_energy(double timestep) {
  ArticulatedDescription model = world_of(timestep, true);
  hang(model, 0);
  hang(model, 1);
  ArticulatedBatch<double> robots(model, 1);
  robots.qpos()[0] = 1.2;
  robots.qpos()[1] = -0.7;
  const double before = energy_of(robots);
  robots.step(static_cast<Index>(std::lround(2 / timestep)));
  return std::fabs(energy_of(robots) - before);
}

TEST(ArticulatedMotion, ADoublePendulumKeepsItsEnergy) {
  const double whole = lost_energy(0.004), half = lost_energy(0.002);
  EXPECT_LT(whole, 1e-4);
  EXPECT_LT(half, whole / 12) << whole;
}

using Vector = std::array<double, 3>;

/// A body's vector in the world, by the quaternion (w, x, y, z) of a free joint.
Vector rotated(const double* q, const Vector& v) {
  const double w = q[0], x = q[1], y = q[2], z = q[3];
  return {(1 - 2 * (y * y + z * z)) * v[0] + 2 * (x * y - w * z) * v[1] + 2 * (x * z + w * y) * v[2],
          2 * (x * y + w * z) * v[0] + (1 - 2 * (x * x + z * z)) * v[1] + 2 * (y * z - w * x) * v[2],
          2 * (x * z - w * y) * v[0] + 2 * (y * z + w * x) * v[1] + (1 - 2 * (x * x + y * y)) * v[2]};
}

/// Change of angular momentum of a body that tumbles about its middle axis and falls, over its momentum.
double tumbling_error(double timestep) {
  constexpr Vector kInertia{0.03, 0.02, 0.01};
  ArticulatedDescription model = world_of(timestep, true);
  ArticulatedBody body;
  body.joints = 1;
  body.mass = 2;
  body.inertia = kInertia;
  body.inverse_weight = {1, 1};
  model.bodies.push_back(body);
  model.joints.push_back({});
  model.joints.back().kind = JointKind::free;
  model.dofs.resize(6);
  ArticulatedBatch<double> robots(model, 1);
  const auto q = robots.qpos(), v = robots.qvel();
  const double start[] = {1, 2, 3, 0.1, 9, -0.2};
  std::copy_n(start, 6, v.begin());
  const auto momentum = [&] { return rotated(&q[3], {kInertia[0] * v[3], kInertia[1] * v[4], kInertia[2] * v[5]}); };
  const Vector before = momentum();
  robots.step(static_cast<Index>(std::lround(2 / timestep)));
  const Vector after = momentum();
  EXPECT_NEAR(q[0], 2, 1e-11);
  EXPECT_NEAR(q[2], 6 - 0.5 * kGravity * 4, 1e-10);
  EXPECT_LT(std::fabs(v[4]), 9.1);
  return std::hypot(after[0] - before[0], after[1] - before[1], after[2] - before[2]) / 0.18;
}

TEST(ArticulatedMotion, AFallingBodyKeepsItsAngularMomentum) {
  const double whole = tumbling_error(0.004), half = tumbling_error(0.002);
  EXPECT_LT(whole, 1e-4);
  EXPECT_LT(half, whole / 12) << whole;
}

/// It moves by its solves' residuals, 1e-16 m a step at this tolerance.
TEST(ArticulatedMotion, ARobotAtRestStaysWhereItIs) {
  ArticulatedOptions options;
  options.tolerance = 1e-10;
  for (const bool is_elliptic : {false, true}) {
    ArticulatedBatch<double> robots(walker(is_elliptic), 4, options);
    for (std::size_t env = 0; env < 4; ++env)
      robots.qpos()[env * static_cast<std::size_t>(robots.q_count()) + 2] += 0.01 * static_cast<double>(env);
    robots.step(25000);
    const std::vector<double> rest(robots.qpos().begin(), robots.qpos().end());
    robots.step(100000);
    double moved = 0;
    for (std::size_t k = 0; k < rest.size(); ++k) moved = std::max(moved, std::fabs(robots.qpos()[k] - rest[k]));
    EXPECT_LT(moved, 1e-9) << is_elliptic;
    for (const EnvStatus& status : robots.status()) EXPECT_EQ(status.code, EnvCode::solved);
  }
}

/// A chain hangs by a joint for each body.
ArticulatedDescription chain(int length) {
  ArticulatedDescription model = world_of(0.002, false);
  for (int k = 0; k < length; ++k) hang(model, k);
  return model;
}

TEST(ArticulatedMotion, SixtyFourDegreesOfFreedomAndNoMore) {
  ArticulatedBatch<double> robots(chain(64), 3);
  robots.qpos()[0] = 0.3;
  robots.step(50);
  for (const EnvStatus& status : robots.status()) EXPECT_EQ(status.code, EnvCode::solved);
  EXPECT_NE(robots.qpos()[0], 0.3);
  EXPECT_EQ(robots.qpos()[64], 0) << "a chain that hangs straight";
  EXPECT_NE(error_message([] { ArticulatedBatch<double>(chain(65), 1); }).find("64"), std::string::npos);
}

TEST(ArticulatedMotion, ModelsWithoutMassOrJointsAreToldApart) {
  ArticulatedDescription massless = chain(1);
  massless.bodies[1].mass = 0;
  massless.bodies[1].inertia = {0, 0, 0};
  ArticulatedBatch<double> robots(massless, 2);
  robots.step();
  for (const EnvStatus& status : robots.status()) {
    EXPECT_EQ(status.code, EnvCode::invalid_input);
    EXPECT_NE(status.flags & kFlagBadMass, 0U);
  }
  EXPECT_EQ(robots.qpos()[0], 0);

  ArticulatedDescription still = world_of(0.002, false);
  still.bodies.push_back({});
  ArticulatedBatch<double> stones(still, 3);
  stones.step(2);
  EXPECT_EQ(stones.dof_count(), 0);
  for (const EnvStatus& status : stones.status()) EXPECT_EQ(status.code, EnvCode::solved);
}

/// A limit from which a joint cannot move holds it: range[0] = range[1].
TEST(ArticulatedMotion, ALockedJointIsHeldByItsLimits) {
  ArticulatedDescription model = chain(1);
  model.joints[0].is_limited = true;
  model.joints[0].range = {0, 0};
  ArticulatedBatch<double> robots(model, 1);
  robots.qvel()[0] = 3;
  robots.step(2000);
  EXPECT_EQ(robots.status()[0].code, EnvCode::solved);
  EXPECT_LT(std::fabs(robots.qpos()[0]), 1e-3);
}

}  // namespace
