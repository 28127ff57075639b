// Worlds whose friction is boxed, against mechanics: the hold of a slope that is turned about the vertical, and the
// path of a sledge.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/systems/worlds.hpp"

namespace stiction::test {
namespace {

constexpr double kGravity = 9.81, kMu = 0.5, kStep = 0.005;

/// A flat box on the floor z = 0. Gravity presses it down with g, and along the floor with `pull` g, at an angle from
/// the x axis.
World<double> box_on_a_slope(bool boxed, double pull, double angle) {
  WorldDescription description;
  description.gravity = {pull * kGravity * std::cos(angle), pull * kGravity * std::sin(angle), -kGravity};
  add_floor(description, kMu);
  add_body(description, ShapeKind::box, {0.2, 0.2, 0.02}, kMu).position = {0, 0, 0.02};
  WorldOptions options;
  options.stepping.dt = kStep;
  options.solver.box_friction = boxed;
  options.solver.iterations = 4000;
  options.solver.tolerance = 1e-10;
  options.solver.threads = 1;
  return {Device::cpu(), description, 1, options};
}

constexpr double kDiagonal = 0.78539816339744830962;  // 45 degrees

// Along an axis friction holds mu; between two axes it holds sqrt(2) mu, where Coulomb's disk holds mu.
TEST(WorldBoxFriction, ASlopeAcrossTheAxesHoldsMore) {
  const double pull = 1.2 * kMu;
  const int steps = 40;
  const auto speed = [&](bool boxed, double angle) {
    World<double> world = box_on_a_slope(boxed, pull, angle);
    run(world, steps);
    return std::hypot(world_twist(world, 0)[0], world_twist(world, 0)[1]);
  };
  const double sliding = (pull - kMu) * kGravity * kStep * steps;
  EXPECT_NEAR(speed(true, 0), sliding, 1e-7) << "along an axis, as Coulomb's";
  EXPECT_NEAR(speed(false, 0), sliding, 1e-7);
  EXPECT_NEAR(speed(false, kDiagonal), sliding, 1e-7) << "Coulomb's law knows no axes";
  EXPECT_NEAR(speed(true, kDiagonal), 0, 1e-7) << "each axis has 0.85 of what it holds";
}

// Every axis is braked by mu g until it stands: the path bends, and ends at v_k^2 / (2 mu g) along each axis. Under
// Coulomb's law it is a straight line of length v^2 / (2 mu g).
TEST(WorldBoxFriction, ASledgeStopsAxisByAxis) {
  const double vx = 1.5, vy = 0.6;
  const auto end_of = [&](bool boxed) {
    World<double> world = box_on_a_slope(boxed, 0, 0);
    const WorldState<double> at = world.state();
    std::vector<double> twist(at.twist.begin(), at.twist.end());
    twist[0] = vx;
    twist[1] = vy;
    const std::vector<double> position(at.position.begin(), at.position.end());
    const std::vector<double> orientation(at.orientation.begin(), at.orientation.end());
    world.reset(std::vector<std::uint8_t>{1}, {position, orientation, twist});
    run(world, 100);  // 0.5 s: v / (mu g) is 0.31 s
    EXPECT_NEAR(std::hypot(world_twist(world, 0)[0], world_twist(world, 0)[1]), 0, 1e-7);
    return position_of(world, 0);
  };
  // Semi-implicit Euler is short of v^2 / (2 a) by up to v h / 2 and the step in which it stops.
  const double brake = kMu * kGravity, error = vx * kStep;
  const auto boxed = end_of(true);
  EXPECT_NEAR(boxed[0], vx * vx / (2 * brake), error);
  EXPECT_NEAR(boxed[1], vy * vy / (2 * brake), error);
  const auto disk = end_of(false);
  const double speed = std::hypot(vx, vy), length = speed * speed / (2 * brake);
  EXPECT_NEAR(disk[0], length * vx / speed, error);
  EXPECT_NEAR(disk[1], length * vy / speed, error);
  EXPECT_GT(disk[1] - boxed[1], 0.05) << "the two laws end far apart";
}

}  // namespace
}  // namespace stiction::test
