// Worlds against mechanics: bodies that fly, spin, collide, slide, bounce and stand.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "tests/support/systems/worlds.hpp"

namespace stiction::test {

namespace {

constexpr double kGravity = 9.81;

WorldOptions tight(double dt = 0.005) {
  WorldOptions options;
  options.stepping.dt = dt;
  options.solver.iterations = 3000;
  options.solver.tolerance = 1e-11;
  options.solver.threads = 1;
  return options;
}

/// Bodies of all kinds flying towards each other without gravity.
WorldDescription colliding(double restitution, bool alike) {
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> unit(-1, 1);
  WorldDescription world;
  world.gravity = {0, 0, 0};
  for (int k = 0; k < 9; ++k) {
    const ShapeKind kind = k % 3 == 1 && !alike ? ShapeKind::capsule : k % 3 == 2 ? ShapeKind::box : ShapeKind::sphere;
    WorldBody& body =
        add_body(world, kind, alike ? std::array{0.1, 0.1, 0.1} : std::array{0.1, 0.15, 0.08}, 0.4, restitution);
    body.position = {0.4 * (k % 3 - 1), 0.4 * (k / 3 - 1), 0.1 * unit(random)};
    for (std::size_t j = 0; j < 3; ++j) body.twist[j] = -2 * body.position[j] + 0.3 * unit(random);
    for (std::size_t j = 3; j < 6; ++j) body.twist[j] = 3 * unit(random);
  }
  return world;
}

}  // namespace

TEST(World, FreeFallIsSemiImplicitEulerToRounding) {
  WorldDescription description;
  WorldBody& ball = add_body(description, ShapeKind::sphere, {0.1, 0, 0});
  ball.position = {1, 2, 3};
  ball.twist = {0.5, 0, 2, 0, 0, 1};
  World<double> world(Device::cpu(), description, 1, tight());
  const int n = 200;
  const double h = 0.005;
  run(world, n);
  // v_k = v_0 - k g h, z_n = z_0 + h (v_1 + ... + v_n).
  EXPECT_NEAR(position_of(world, 0)[2], 3 + n * h * 2 - kGravity * h * h * n * (n + 1) / 2, 1e-12);
  EXPECT_NEAR(position_of(world, 0)[0], 1 + n * h * 0.5, 1e-12);
  EXPECT_NEAR(world_twist(world, 0)[2], 2 - n * h * kGravity, 1e-12);
  // Cayley's map turns by 2 atan(h w / 2) a step.
  const double angle = n * 2 * std::atan(h / 2);
  EXPECT_NEAR(world.state().orientation[0], std::cos(angle / 2), 1e-12);
  EXPECT_NEAR(world.state().orientation[3], std::sin(angle / 2), 1e-12);
}

TEST(World, ATumblingBoxKeepsItsAngularMomentumAndNearlyItsEnergy) {
  WorldDescription description;
  description.gravity = {0, 0, 0};
  WorldBody& box = add_body(description, ShapeKind::box, {0.1, 0.2, 0.3});
  box.twist = {0, 0, 0, 0.01, 4, 0.01};  // about the middle axis: it turns over
  const auto drift = [&](double dt, double seconds) {
    World<double> world(Device::cpu(), description, 1, tight(dt));
    const WorldMotion before = world.motion()[0];
    double lowest = 1e9;
    for (int step = 0; step < seconds / dt; ++step) {
      world.step();
      lowest = std::min(
          lowest, 1 - 2 * std::pow(world.state().orientation[1], 2) - 2 * std::pow(world.state().orientation[3], 2));
    }
    const WorldMotion after = world.motion()[0];
    for (int k = 0; k < 3; ++k)
      EXPECT_NEAR(after.angular_momentum[k], before.angular_momentum[k], 1e-11 * before.angular_momentum[1]);
    EXPECT_LT(lowest, -0.9);  // its middle axis has pointed the other way: this is no rotation about one axis
    return std::abs(after.kinetic / before.kinetic - 1);
  };
  const double coarse = drift(0.005, 20);
  const double fine = drift(0.0025, 20);
  EXPECT_LT(coarse, 1e-2);
  EXPECT_LT(fine, coarse / 3);  // of second order
}

TEST(World, CollisionsConserveLinearAndAngularMomentum) {
  for (const double restitution : {0.0, 0.7}) {
    World<double> world(Device::cpu(), colliding(restitution, false), 1, tight());
    const WorldMotion before = world.motion()[0];
    Offset most = 0;
    for (int step = 0; step < 200; ++step) {
      world.step();
      most = std::max(most, world.contact_offsets()[1]);
    }
    const WorldMotion after = world.motion()[0];
    EXPECT_GE(most, 4);
    EXPECT_LT(after.kinetic, 0.95 * before.kinetic);  // something has happened
    for (int k = 0; k < 3; ++k) {
      EXPECT_NEAR(after.momentum[k], before.momentum[k], 1e-11) << restitution;
      EXPECT_NEAR(after.angular_momentum[k], before.angular_momentum[k], 1e-11) << restitution;
    }
  }
}

TEST(World, WithoutStabilisationNoStepOfInelasticBodiesAddsEnergy) {
  // Balls and cubes: their spin has no gyroscopic term, whose own error has a sign that may be either.
  WorldDescription description = colliding(0, true);
  description.gravity = {0, 0, -kGravity};
  add_floor(description);
  for (WorldBody& body : description.bodies) body.position[2] += 0.5;
  WorldOptions options = tight();
  options.stepping.erp = 0;
  World<double> world(Device::cpu(), description, 1, options);
  double energy = energy_of(world);
  const double scale = energy;
  for (int step = 0; step < 300; ++step) {
    world.step();
    const double next = energy_of(world);
    // The residual that is left, 1e-11 of velocities of some m/s, on some tens of kg.
    EXPECT_LE(next, energy + 1e-8 * scale) << "step " << step;
    energy = next;
  }
  EXPECT_LT(energy, 0.7 * scale);
}

TEST(World, ABlockSlidesOrStopsByItsFriction) {
  const double tangent = 0.3, c = 1 / std::sqrt(1 + tangent * tangent), s = tangent * c;
  for (const double mu : {0.2, 0.29, 0.31, 0.5}) {
    WorldDescription description;
    description.gravity = {kGravity * s, 0, -kGravity * c};
    add_floor(description, mu);
    WorldBody& block = add_body(description, ShapeKind::box, {0.15, 0.1, 0.05}, mu);
    block.position = {0, 0, 0.05};
    block.twist = {1, 0, 0, 0, 0, 0};
    World<double> world(Device::cpu(), description, 1, tight());
    const int n = 400;
    run(world, n);
    const double h = 0.005, acceleration = kGravity * (s - mu * c), speed = 1 + n * h * acceleration;
    const double x = position_of(world, 0)[0];
    if (mu < tangent) {
      EXPECT_NEAR(world_twist(world, 0)[0], speed, 1e-6) << mu;
      EXPECT_NEAR(x, n * h + acceleration * h * h * n * (n + 1) / 2, 1e-5) << mu;
    } else if (mu == 0.5) {
      EXPECT_NEAR(world_twist(world, 0)[0], 0, 1e-9) << mu;
      EXPECT_NEAR(x, 1 / (-2 * acceleration), h) << mu;  // v^2 / 2a, to the step in which it stops
    } else {
      EXPECT_NEAR(world_twist(world, 0)[0], speed, 1e-6) << mu;  // it brakes, too little to stop in this time
      EXPECT_LT(world_twist(world, 0)[0], 1) << mu;
    }
  }
}

TEST(World, ABlockAtRestStaysBelowTheAngleOfFrictionAndSlidesAboveIt) {
  for (const double mu : {0.295, 0.305}) {
    const double tangent = 0.3, c = 1 / std::sqrt(1 + tangent * tangent), s = tangent * c;
    WorldDescription description;
    description.gravity = {kGravity * s, 0, -kGravity * c};
    add_floor(description, mu);
    add_body(description, ShapeKind::box, {0.15, 0.1, 0.05}, mu).position = {0, 0, 0.05};
    World<double> world(Device::cpu(), description, 1, tight());
    run(world, 200);
    const double slid = 200 * 0.005 * kGravity * (s - mu * c);
    EXPECT_NEAR(world_twist(world, 0)[0], mu < tangent ? slid : 0, 1e-6);
  }
}

TEST(World, BallsRiseByTheSquareOfTheirRestitution) {
  WorldOptions options = tight();
  World<double> world = started<double>("bounce", 1, options);
  const double radius = 0.1;
  std::array<std::vector<double>, 3> apexes;
  std::array<double, 3> before{}, climbing{};
  for (std::size_t ball = 0; ball < 3; ++ball) {
    apexes[ball].push_back(position_of(world, static_cast<Offset>(ball))[2] - radius);
    before[ball] = apexes[ball][0] + radius;
  }
  for (int step = 0; step < 1500; ++step) {
    world.step();
    for (std::size_t ball = 0; ball < 3; ++ball) {
      const double z = position_of(world, static_cast<Offset>(ball))[2];
      const bool up = z > before[ball];
      if (climbing[ball] > 0 && !up) apexes[ball].push_back(before[ball] - radius);
      climbing[ball] = up ? 1 : 0;
      before[ball] = z;
    }
  }
  const double restitution[] = {0.3, 0.6, 0.9};
  for (std::size_t ball = 0; ball < 3; ++ball) {
    ASSERT_GE(apexes[ball].size(), 2U);
    const double e = restitution[ball];
    // A step of 1 ms at some 3 m/s: the impact is early by up to 3 mm, and its speed off by g dt.
    EXPECT_NEAR(apexes[ball][1] / apexes[ball][0], e * e, 0.01) << ball;
  }
  ASSERT_GE(apexes[2].size(), 3U);
  EXPECT_NEAR(apexes[2][2] / apexes[2][1], 0.81, 0.01);
}

TEST(World, ARimlessWheelWalksAtItsLimitCycle) {
  using Wheel = scenes::RimlessWheel;
  World<double> world = started<double>("walker", 1, tight());
  const double alpha = std::acos(-1.0) / Wheel::kSpokes, gamma = std::atan(Wheel::kSlope),
               inertia = 1 + Wheel::kGyration;
  // McGeer 1990: an impact keeps the momentum about the new foot, the swing between two keeps energy.
  const double kept = (std::cos(2 * alpha) + Wheel::kGyration) / inertia;
  const double gained = 4 * kGravity * std::sin(alpha) * std::sin(gamma) / (Wheel::kLength * inertia);
  const double spin_before = std::sqrt(gained / (1 - kept * kept));
  const double spin_after = kept * spin_before;
  // Time of a swing from -alpha to alpha about the foot, by Simpson's rule.
  double seconds = 0;
  const int parts = 2000;
  for (int k = 0; k <= parts; ++k) {
    const double angle = -alpha + 2 * alpha * k / parts;
    const double fallen = std::cos(-alpha + gamma) - std::cos(angle + gamma);
    const double spin = std::sqrt(spin_after * spin_after + 2 * kGravity * fallen / (Wheel::kLength * inertia));
    seconds += (k == 0 || k == parts ? 1 : (k % 2 == 1 ? 4 : 2)) / spin;
  }
  seconds *= 2 * alpha / parts / 3;
  const double speed = 2 * Wheel::kLength * std::sin(alpha) / seconds;

  const double dt = scenes::make_world("walker").stepping.dt;
  run(world, static_cast<int>(15 / dt));  // the cycle draws near by kept^2 = 0.65 a step
  const double x = position_of(world, 0)[0];
  const int lasting = static_cast<int>(std::lround(10 * seconds / dt));
  double fastest = 0, slowest = 1e9;
  for (int step = 0; step < lasting; ++step) {
    world.step();
    fastest = std::max(fastest, world_twist(world, 0)[4]);
    slowest = std::min(slowest, world_twist(world, 0)[4]);
  }
  // Feet are balls of a hundredth of the length: they roll, which the theory's points do not.
  EXPECT_NEAR((position_of(world, 0)[0] - x) / (lasting * dt), speed, 0.03 * speed);
  EXPECT_NEAR(fastest, spin_before, 0.03 * spin_before);
  EXPECT_LT(slowest, spin_after);
  EXPECT_NEAR(position_of(world, 0)[1], 0, 1e-6);
}

TEST(World, AStackAtRestStays) {
  WorldOptions options;
  options.solver.threads = 1;
  World<double> world = started<double>("stack", 1, options);
  run(world, 100);
  std::vector<double> before(world.state().position.begin(), world.state().position.end());
  run(world, 400);
  for (std::size_t k = 0; k < before.size(); ++k) EXPECT_NEAR(world.state().position[k], before[k], 2e-4);
  for (Offset body = 0; body < 5; ++body)
    for (const double v : world_twist(world, body)) EXPECT_NEAR(v, 0, 1e-3);
}

TEST(World, NewtonAndImpulsesCarryAStackWithTheSameVelocities) {
  const auto fallen = [](BodyMethod method) {
    WorldOptions options = tight();
    options.solver.method = method;
    options.solver.tolerance = 1e-8;
    options.stepping.cfm = 1e-5;  // with compliance the answer is one
    const scenes::WorldScene scene = scenes::make_world("stack");
    options.stepping.dt = scene.stepping.dt;
    World<double> world(Device::cpu(), scene.description, 1, options);
    scenes::start_all(world, "stack", 0);
    for (int step = 0; step < 40; ++step) {
      world.step();
      EXPECT_EQ(world.status()[0].code, EnvCode::solved) << "step " << step;
    }
    return std::vector<double>(world.state().position.begin(), world.state().position.end());
  };
  const std::vector<double> impulses = fallen(BodyMethod::impulses), newton = fallen(BodyMethod::newton);
  for (std::size_t k = 0; k < impulses.size(); ++k) EXPECT_NEAR(impulses[k], newton[k], 1e-7);
}

TEST(World, ContactsKeepTheirNamesAndWarmStartsSaveSweeps) {
  const auto sweeps = [](double share) {
    WorldOptions options = tight();
    options.solver.tolerance = 1e-6;
    options.warm_start = share;
    World<double> world = started<double>("stack", 1, options);
    run(world, 100);
    const auto first = world.contacts();
    const std::vector<std::uint64_t> names(first.contact_id, first.contact_id + first.contact_count);
    EXPECT_EQ(names.size(), 20U);
    EXPECT_TRUE(std::is_sorted(names.begin(), names.end()));
    std::int64_t sum = 0;
    for (int step = 0; step < 20; ++step) {
      world.step();
      sum += world.status()[0].iterations;
      const auto now = world.contacts();
      EXPECT_EQ(names, std::vector<std::uint64_t>(now.contact_id, now.contact_id + now.contact_count));
    }
    return sum;
  };
  EXPECT_LT(2 * sweeps(1.0), sweeps(0.0));
}

}  // namespace stiction::test
