// Behaviour that a caller of World may rely on: resets, wrenches, capacity, broken environments, refusals.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "tests/support/error_message.hpp"
#include "tests/support/systems/worlds.hpp"

namespace stiction::test {

namespace {

using testing::HasSubstr;

WorldDescription ball_above_floor() {
  WorldDescription world;
  add_floor(world);
  add_body(world, ShapeKind::sphere, {0.1, 0, 0}).position = {0, 0, 0.5};
  return world;
}

std::string refusal(const WorldDescription& description, const WorldOptions& options = {}, Offset envs = 1) {
  return error_message([&] { World<double>(Device::cpu(), description, envs, options); });
}

std::vector<double> copy_of(std::span<const double> values) {
  return {values.begin(), values.end()};
}

}  // namespace

TEST(WorldUse, AWrenchAcceleratesByMassAndInertia) {
  WorldDescription description;
  description.gravity = {0, 0, 0};
  const WorldBody body = add_body(description, ShapeKind::box, {0.1, 0.1, 0.1});
  World<double> world(Device::cpu(), description, 2);
  world.wrench()[6] = 3;  // of the second environment
  world.wrench()[6 + 4] = 0.2;
  run(world, 10);
  EXPECT_NEAR(world_twist(world, 1)[0], 10 * 0.005 * 3 / body.mass, 1e-14);
  EXPECT_NEAR(world_twist(world, 1)[4], 10 * 0.005 * 0.2 / body.inertia[1], 1e-12);
  for (const double v : world_twist(world, 0)) EXPECT_EQ(v, 0);
}

TEST(WorldUse, ResetBeginsAgainWhereTheMaskSays) {
  World<double> world(Device::cpu(), ball_above_floor(), 3);
  run(world, 120);
  const std::vector<double> landed = copy_of(world.state().position);
  world.reset(std::vector<std::uint8_t>{0, 1, 0});
  EXPECT_EQ(world.state().position[5], 0.5);
  EXPECT_EQ(world.state().twist[6 + 2], 0);
  EXPECT_EQ(world.state().position[2], landed[2]);
  // No earlier state reaches later ones: it falls as a new one does.
  World<double> fresh(Device::cpu(), ball_above_floor(), 1);
  run(world, 120);
  run(fresh, 120);
  for (std::size_t k = 0; k < 3; ++k) EXPECT_EQ(world.state().position[3 + k], fresh.state().position[k]);
}

TEST(WorldUse, ResetTakesStatesAndNormalisesQuaternions) {
  World<double> world(Device::cpu(), ball_above_floor(), 1);
  const std::vector<double> position{1, 2, 3}, orientation{2, 0, 0, 0}, twist{1, 0, 0, 0, 0, 0};
  const std::vector<std::uint8_t> all{1};
  world.reset(all, {position, orientation, twist});
  EXPECT_EQ(copy_of(world.state().position), position);
  EXPECT_EQ(world.state().orientation[0], 1);
  const std::vector<double> nowhere{0, 0, 0, 0};
  EXPECT_THAT(error_message([&] { world.reset(all, {position, nowhere, twist}); }), HasSubstr("zero quaternion"));
  EXPECT_THAT(error_message([&] { world.reset(all, {twist, orientation, twist}); }),
              HasSubstr("state.position has 6 entries, expected 3"));
  EXPECT_THAT(error_message([&] { world.reset(std::vector<std::uint8_t>{1, 1}); }), HasSubstr("mask has 2 entries"));
}

TEST(WorldUse, AnEnvironmentWithABrokenWrenchStandsStillAlone) {
  World<double> world(Device::cpu(), ball_above_floor(), 3);
  World<double> sound(Device::cpu(), ball_above_floor(), 3);
  world.wrench()[6] = std::numeric_limits<double>::quiet_NaN();
  run(world, 10);
  run(sound, 10);
  EXPECT_EQ(world.status()[1].code, EnvCode::invalid_input);
  EXPECT_NE(world.status()[1].flags & kFlagNonFiniteInput, 0U);
  EXPECT_EQ(world.state().position[5], 0.5);
  for (const std::size_t env : {0U, 2U}) {
    EXPECT_EQ(world.status()[env].code, EnvCode::solved);
    for (std::size_t k = 0; k < 3; ++k)
      EXPECT_EQ(world.state().position[3 * env + k], sound.state().position[3 * env + k]);
  }
  // Mended, it goes on.
  world.wrench()[6] = 0;
  world.step();
  EXPECT_LT(world.state().position[5], 0.5);
}

TEST(WorldUse, SpeedsBeyondAllNumbersEndAsInvalidInput) {
  WorldDescription description = ball_above_floor();
  description.bodies[0].twist[0] = 1e308;
  WorldOptions options;
  options.stepping.dt = 10;
  World<double> world(Device::cpu(), description, 1, options);
  run(world, 3);
  EXPECT_EQ(world.status()[0].code, EnvCode::invalid_input);
  world.reset(std::vector<std::uint8_t>{1});
  EXPECT_TRUE(std::isfinite(world.state().position[0]));
}

/// Squares of such spins overflow, so that the quaternion after the step has no length. No later step may call its
/// successors solved.
TEST(WorldUse, ABodyThatIsTurnedNoWayEndsAsInvalidInputAlone) {
  World<double> world(Device::cpu(), ball_above_floor(), 2);
  World<double> sound(Device::cpu(), ball_above_floor(), 2);
  WorldCheckpoint<double> point = world.checkpoint();
  std::fill_n(point.orientation.begin(), 4, 0.0);
  world.resume(point);
  run(world, 3);
  run(sound, 3);
  EXPECT_EQ(world.status()[0].code, EnvCode::invalid_input);
  EXPECT_EQ(world.state().position[2], 0.5);
  EXPECT_EQ(world.state().orientation[0], 0.0);
  EXPECT_EQ(world.status()[1].code, EnvCode::solved);
  EXPECT_EQ(world.state().position[5], sound.state().position[5]);
}

TEST(WorldUse, TooManyContactsAreFlaggedAndTheDeepestKept) {
  WorldOptions options;
  options.solver.max_contacts_per_env = 6;
  World<double> world = started<double>("stack", 2, options);
  run(world, 20);
  EXPECT_NE(world.status()[0].flags & kFlagContactsDropped, 0U);
  const auto contacts = world.contacts();
  const Offset count = contacts.env_contact_offsets[1];
  ASSERT_GT(count, 6);
  std::vector<double> depths(contacts.depth, contacts.depth + count);
  std::sort(depths.begin(), depths.end(), std::greater<>());
  Offset pushed = 0;
  for (Offset c = 0; c < count; ++c) {
    if (!(world.impulses()[static_cast<std::size_t>(3 * c)] > 0)) continue;
    ++pushed;
    EXPECT_GE(contacts.depth[c], depths[5]) << "contact " << c;
  }
  EXPECT_LE(pushed, 6);
  EXPECT_GT(pushed, 0);
}

TEST(WorldUse, CompoundBodiesTouchWithEveryShapeAndNeverThemselves) {
  WorldDescription description;
  add_floor(description);
  WorldBody dumbbell;
  dumbbell.mass = 2;
  dumbbell.inertia = {0.02, 0.1, 0.1};
  dumbbell.position = {0, 0, 0.1};
  description.bodies.push_back(dumbbell);
  for (const double x : {-0.05, 0.05}) {  // they overlap each other
    description.shapes.push_back(world_shape(0, ShapeKind::sphere, {0.1, 0, 0}));
    description.shapes.back().position = {x, 0, 0};
  }
  World<double> world(Device::cpu(), description, 1);
  run(world, 50);
  EXPECT_EQ(world.contact_offsets()[1], 2);
  EXPECT_NEAR(position_of(world, 0)[2], 0.1, 1e-4);
  double carried = 0;
  for (std::size_t c = 0; c < 2; ++c) carried += world.impulses()[3 * c];
  EXPECT_NEAR(carried, 2 * 9.81 * 0.005, 1e-6);
}

TEST(WorldUse, AnEmptyWorldSteps) {
  World<double> none(Device::cpu(), ball_above_floor(), 0);
  none.step();
  World<float> bare(Device::cpu(), WorldDescription{}, 2);
  bare.step();
  EXPECT_EQ(bare.status().size(), 2U);
  EXPECT_EQ(bare.status()[0].code, EnvCode::solved);
}

TEST(WorldUse, SolidBodiesHaveTheMassesOfTheTextbooks) {
  const double pi = std::acos(-1.0);
  const WorldBody ball = solid_body(world_shape(0, ShapeKind::sphere, {0.5, 0, 0}), 10);
  EXPECT_NEAR(ball.mass, 10 * 4 * pi / 3 / 8, 1e-12);
  EXPECT_NEAR(ball.inertia[0], 0.4 * ball.mass * 0.25, 1e-12);
  const WorldBody box = solid_body(world_shape(0, ShapeKind::box, {0.5, 1, 1.5}), 1);
  EXPECT_NEAR(box.mass, 6, 1e-12);
  EXPECT_NEAR(box.inertia[0], 6.0 / 12 * (4 + 9), 1e-12);
  // A capsule is its slices: discs of thickness dz, summed.
  const double r = 0.3, h = 0.4;
  double mass = 0, axial = 0, across = 0;
  const int slices = 200000;
  for (int k = 0; k < slices; ++k) {
    const double z = (r + h) * (2.0 * (k + 0.5) / slices - 1), beyond = std::max(std::abs(z) - h, 0.0);
    const double square = r * r - beyond * beyond, m = pi * square * 2 * (r + h) / slices;
    mass += m;
    axial += m * square / 2;
    across += m * (square / 4 + z * z);
  }
  const WorldBody capsule = solid_body(world_shape(0, ShapeKind::capsule, {r, h, 0}), 1);
  EXPECT_NEAR(capsule.mass, mass, 1e-6);
  EXPECT_NEAR(capsule.inertia[2], axial, 1e-6);
  EXPECT_NEAR(capsule.inertia[0], across, 1e-6);
  EXPECT_EQ(capsule.inertia[0], capsule.inertia[1]);
}

TEST(WorldUse, MistakesAreNamed) {
  const auto changed = [](auto&& change) {
    WorldDescription description = ball_above_floor();
    change(description);
    return refusal(description);
  };
  EXPECT_THAT(changed([](auto& d) { d.bodies[0].mass = 0; }), HasSubstr("bodies[0].mass = 0: must be finite and > 0"));
  EXPECT_THAT(changed([](auto& d) { d.bodies[0].inertia[2] = -1; }), HasSubstr("bodies[0].inertia[2] = -1"));
  EXPECT_THAT(changed([](auto& d) { d.bodies[0].orientation = {1, 1, 0, 0}; }), HasSubstr("unit quaternion"));
  EXPECT_THAT(changed([](auto& d) { d.shapes[1].size[0] = 0; }), HasSubstr("shapes[1].size[0] = 0"));
  EXPECT_THAT(changed([](auto& d) { d.shapes[1].body = 1; }), HasSubstr("shapes[1].body = 1"));
  EXPECT_THAT(changed([](auto& d) { d.shapes[0].body = 0; }), HasSubstr("planes belong to the world"));
  EXPECT_THAT(changed([](auto& d) { d.shapes[0].mu = -1; }), HasSubstr("shapes[0].mu = -1"));
  EXPECT_THAT(changed([](auto& d) { d.shapes[0].restitution = 2; }), HasSubstr("in [0, 1]"));
  EXPECT_THAT(changed([](auto& d) { d.gravity[0] = std::nan(""); }), HasSubstr("gravity"));
  WorldOptions options;
  options.solver.substeps = 2;
  EXPECT_THAT(refusal(ball_above_floor(), options), HasSubstr("solver.substeps = 2: must be 1"));
  options = {};
  options.margin = -1;
  EXPECT_THAT(refusal(ball_above_floor(), options), HasSubstr("margin = -1"));
  options = {};
  options.warm_start = 1.5;
  EXPECT_THAT(refusal(ball_above_floor(), options), HasSubstr("warm_start = 1.5"));
  EXPECT_THAT(refusal(ball_above_floor(), {}, -1), HasSubstr("env_count = -1"));
  options = {};
  options.stepping.dt = 0;
  EXPECT_THAT(refusal(ball_above_floor(), options), HasSubstr("dt = 0"));
  EXPECT_THAT(error_message([] { solid_body(world_shape(-1, ShapeKind::plane, {}), 1); }), HasSubstr("no mass"));
}

}  // namespace stiction::test
