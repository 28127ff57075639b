#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <span>
#include <utility>
#include <vector>

#include "stiction/articulated.hpp"
#include "stiction/hash.hpp"
#include "tests/support/error_message.hpp"
#include "tests/support/machines/same_on_all_kernels.hpp"
#include "tests/support/systems/walker_states.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

template <class Real>
std::uint64_t hash_after(bool is_elliptic, bool is_rk4, int threads) {
  ArticulatedOptions options;
  options.tolerance = 1e-5;
  options.threads = threads;
  ArticulatedBatch<Real> robots(walker(is_elliptic, is_rk4), kEnvs, options);
  put_states(robots, all_envs());
  robots.step(12);
  return robots.hash();
}

TEST(Articulated, EveryInstructionSetAndWidthAndNumberOfThreadsGivesTheSameBits) {
  for (const bool is_elliptic : {false, true})
    for (const bool is_rk4 : {false, true}) {
      expect_same_on_all_kernels(
          [&](auto real, int threads) { return hash_after<decltype(real)>(is_elliptic, is_rk4, threads); });
    }
}

TEST(Articulated, RobotsRestAndFriendsDoNotReachThem) {
  ArticulatedBatch<double> robots(walker(true), 8), alone(walker(true), 1);
  put_states(robots, {0, 1, 2, 3, 4, 5, 6, 7});
  put_states(alone, {5});
  robots.step(400);
  alone.step(400);
  const auto nq = static_cast<std::size_t>(robots.q_count());
  for (std::size_t k = 0; k < nq; ++k) EXPECT_EQ(robots.qpos()[5 * nq + k], alone.qpos()[k]) << k;
  for (const EnvStatus& status : robots.status()) EXPECT_EQ(status.code, EnvCode::solved) << status.residual;
}

/// Momentum of robots, from the first rows of M.
std::array<double, 3> momentum_of(ArticulatedBatch<double>& robots, std::size_t env) {
  const ArticulatedProbe probe = robots.probe();
  const auto nv = static_cast<std::size_t>(robots.dof_count());
  std::array<double, 3> sum{};
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (std::size_t k = 0; k < nv; ++k) {
      const std::size_t row = axis < k ? k : axis, column = axis < k ? axis : k;
      sum[axis] += probe.M[(env * nv + row) * nv + column] * robots.qvel()[env * nv + k];
    }
  return sum;
}

/// The change of a robot's momentum in 0.2 s without ground and gravity: joints push both sides alike.
double drift_of(double timestep) {
  ArticulatedDescription model = walker(false, true);
  model.timestep = timestep;
  model.gravity = {0, 0, 0};
  model.pairs.clear();
  for (ArticulatedDof& dof : model.dofs) dof.armature = dof.friction_loss = 0;
  for (ArticulatedJoint& joint : model.joints) joint.is_limited = false;
  ArticulatedBatch<double> robots(model, 3);
  put_states(robots, {0, 1, 2});
  const std::array<double, 3> before[] = {momentum_of(robots, 0), momentum_of(robots, 1), momentum_of(robots, 2)};
  robots.step(static_cast<Index>(std::lround(0.2 / timestep)));
  double largest = 0;
  for (std::size_t env = 0; env < 3; ++env)
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double change = std::fabs(momentum_of(robots, env)[axis] - before[env][axis]);
      largest = change > largest ? change : largest;
    }
  return largest;
}

/// Runge and Kutta's method leaves a fourth power of the step: a sixteenth at half the step.
TEST(Articulated, FreeRobotsKeepTheirMomentum) {
  const double whole = drift_of(0.002), half = drift_of(0.001);
  EXPECT_LT(whole, 1e-3);
  EXPECT_LT(half, whole / 12) << whole;
}

/// A robot whose knees pull one tendon.
ArticulatedDescription with_tendon(bool is_elliptic, bool is_rk4) {
  ArticulatedDescription model = walker(is_elliptic, is_rk4);
  model.tendons = 1;
  model.tendon_terms = {{0, 2, 1.5}, {0, 4, -0.5}};
  return model;
}

template <class Real>
std::uint64_t observed_after(bool is_elliptic, int threads = 1) {
  ArticulatedBatch<Real> robots(with_tendon(is_elliptic, !is_elliptic), kEnvs, {1e-5, 100, threads, true});
  put_states(robots, all_envs());
  robots.step(12);
  robots.step(3);
  std::vector<Real> all;
  for (std::size_t k = 0; k <= static_cast<std::size_t>(ObservedArray::ten_velocity); ++k) {
    const std::span<Real> one = robots.observed(static_cast<ObservedArray>(k));
    all.insert(all.end(), one.begin(), one.end());
  }
  return hash_bits(std::span<const Real>(all));
}

TEST(Articulated, NoInstructionSetAndNoThreadChangesWhatIsObserved) {
  for (const bool is_elliptic : {false, true})
    expect_same_on_all_kernels(
        [&](auto real, int threads) { return observed_after<decltype(real)>(is_elliptic, threads); });
}

/// Contact forces on a robot that rests are its weight, and act below the centre of mass.
TEST(Articulated, ForcesOfContactsHoldARobotThatRests) {
  const ArticulatedDescription model = with_tendon(true, false);
  ArticulatedBatch<double> robots(model, 2, {1e-9, 100, 1, true});
  robots.step(4000);
  const std::array<std::uint8_t, 2> first{1, 0};
  const std::span<double> force = robots.observed(ObservedArray::cfrc_ext);
  for (double& number : force) number = -1;
  robots.forward(first);
  std::array<double, 6> sum{};
  double weight = 0;
  for (std::size_t b = 0; b < model.bodies.size(); ++b) {
    weight += 9.81 * model.bodies[b].mass;
    for (std::size_t k = 0; k < 6; ++k) sum[k] += force[6 * b + k];
    EXPECT_EQ(force[6 * (model.bodies.size() + b)], -1);  // the other was left out
  }
  EXPECT_NEAR(sum[5], weight, 1e-3 * weight);
  for (std::size_t k = 0; k < 5; ++k) EXPECT_NEAR(sum[k], 0, 1e-2 * weight) << k;
}

TEST(Articulated, NothingIsObservedThatWasNotAskedFor) {
  ArticulatedBatch<double> robots(with_tendon(true, false), 2);
  robots.forward();
  EXPECT_TRUE(robots.observed(ObservedArray::xpos).empty());
  EXPECT_EQ(robots.observed_width(ObservedArray::ten_length), 1);
  EXPECT_THROW(robots.forward(std::vector<std::uint8_t>(3)), Error);
}

TEST(Articulated, ReasonsNameWhatIsNotStepped) {
  const auto message = [](auto&& change) {
    ArticulatedDescription model = walker(true);
    change(model);
    return error_message([&] { ArticulatedBatch<double>(model, 1); });
  };
  const auto says = [&](const char* text, auto&& change) {
    const std::string found = message(change);
    EXPECT_NE(found.find(text), std::string::npos) << found;
  };
  says("bodies is empty", [](auto& m) { m.bodies.clear(); });
  says("bodies[2].parent = 2", [](auto& m) { m.bodies[2].parent = 2; });
  says("is free: must be its body's only one", [](auto& m) {
    m.joints[1].kind = JointKind::free;
    m.dofs.resize(17);
  });
  says("limits of free and ball joints", [](auto& m) { m.joints[1].is_limited = true; });
  says("solimp[4] = 1.5", [](auto& m) { m.pairs[0].give.solimp[4] = 1.5; });
  says("dim = 5", [](auto& m) { m.pairs[0].dim = 5; });
  says("give the plane first", [](auto& m) { m.geoms[0].body = 1; });
  says("geoms[1].kind = 4: must be", [](auto& m) { m.geoms[1].kind = static_cast<GeomKind>(4); });
  says("pairs[1]: planes touch", [](auto& m) { std::swap(m.pairs[1].geom_a, m.pairs[1].geom_b); });
  says("joints[1].axis holds a number", [](auto& m) { m.joints[1].axis[0] = std::nan(""); });
  says("equalities[1]: those of hinges and slides alone", [](auto& m) { m.equalities.push_back({1, 2, {}, {}}); });
  says("actuators[0].joint = 9", [](auto& m) { m.actuators[0].joint = 9; });
  says("tendon_terms[0].tendon = 1", [](auto& m) {
    m = with_tendon(true, false);
    m.tendon_terms[0].tendon = 1;
  });
  says("tendon_terms[1].joint: must be a hinge", [](auto& m) {
    m = with_tendon(true, false);
    m.tendon_terms[1].joint = 1;
  });
  says("dofs has 13 entries", [](auto& m) { m.dofs.resize(13); });
  EXPECT_NE(error_message([] { ArticulatedBatch<float>(walker(true), 1, {1e-7, 100, 0}); }).find("1e-5"),
            std::string::npos);
}

}  // namespace
