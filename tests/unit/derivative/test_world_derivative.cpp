// Derivatives of a world's step: against finite differences of the step itself.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "core/runtime/world/spin_change.hpp"
#include "stiction/world_derivative.hpp"
#include "tests/support/error_message.hpp"
#include "tests/support/systems/derivative_cases.hpp"
#include "tests/support/systems/worlds.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

/// Start of all environments of a world.
struct Begin {
  std::vector<double> position, orientation, twist, wrench;
};

/// Contacts yield, and are solved until nothing is left to solve.
WorldOptions exact(Law law) {
  WorldOptions options;
  options.stepping.cfm = 1e-3;
  options.solver.law = law;
  options.solver.iterations = 20000;
  options.solver.tolerance = 1e-13;
  options.solver.threads = 1;
  options.warm_start = 0;
  return options;
}

World<double> started(const WorldDescription& description, Offset envs, const WorldOptions& options, const Begin& at) {
  World<double> world(Device::cpu(), description, envs, options);
  const std::vector<std::uint8_t> all(static_cast<std::size_t>(envs), 1);
  world.reset(all, WorldState<double>{at.position, at.orientation, at.twist});
  std::copy(at.wrench.begin(), at.wrench.end(), world.wrench().begin());
  return world;
}

struct Bars {
  std::vector<double> twist, position;
};

double loss(const WorldDescription& description, Offset envs, const WorldOptions& options, const Begin& at,
            const Bars& bars) {
  World<double> world = started(description, envs, options, at);
  world.step();
  const auto after = world.state();
  return dot(std::vector<double>(after.twist.begin(), after.twist.end()), bars.twist) +
         dot(std::vector<double>(after.position.begin(), after.position.end()), bars.position);
}

/// A ball, a box and a brick on the floor, and a ball on the box: sliding, rolling, bouncing, apart.
struct Heap {
  WorldDescription description;
  Begin begin;
  static constexpr Offset kEnvs = 8;

  explicit Heap(double restitution) {
    description.shapes.push_back(world_shape(-1, ShapeKind::plane, {0, 0, 0}, 0.6, restitution));
    add_body(description, ShapeKind::sphere, {0.1, 0, 0}, 0.4, restitution);
    add_body(description, ShapeKind::box, {0.2, 0.2, 0.2}, 0.5);
    add_body(description, ShapeKind::box, {0.1, 0.2, 0.3}, 0.3);
    add_body(description, ShapeKind::sphere, {0.1, 0, 0}, 0.7);
    scenes::Rng rng(3);
    for (Offset env = 0; env < kEnvs; ++env) {
      const double over = env % 3 == 2 ? -1e-3 : 1e-4;
      begin.position.insert(begin.position.end(),
                            {0, 0, 0.1 - over, 1, 0, 0.2 - over, 3, 0, 0.3 - over, 1, 0, 0.5 - 2 * over});
      for (int body = 0; body < 4; ++body) {
        begin.orientation.insert(begin.orientation.end(), {1, 0, 0, 0});
        for (int k = 0; k < 6; ++k) {
          begin.twist.push_back(k == 2 ? -0.4 + rng.symmetric(0.3) : rng.symmetric(1.0));
          begin.wrench.push_back(rng.symmetric(20.0));
        }
      }
    }
  }
};

double relative_error(double difference, const std::vector<double>& gradient, const std::vector<double>& direction) {
  double size = 1e-9;
  for (std::size_t i = 0; i < gradient.size(); ++i) size += std::abs(gradient[i] * direction[i]);
  return std::abs(difference - dot(gradient, direction)) / size;
}

TEST(WorldDerivative, IsThatOfDifferencesOfTheStep) {
  constexpr double kStep = 1e-6;
  for (const Law law : {Law::convex, Law::coulomb})
    for (const double restitution : {0.0, 0.6}) {
      SCOPED_TRACE(std::string(to_string(law)) + ", restitution " + std::to_string(restitution));
      const Heap heap(restitution);
      const WorldOptions options = exact(law);
      World<double> world = started(heap.description, Heap::kEnvs, options, heap.begin);
      const WorldStep<double> step(world);
      EXPECT_GT(world.contact_offsets()[Heap::kEnvs], 8 * 5);
      const Bars bars{random_numbers(heap.begin.twist.size(), 1), std::vector<double>(heap.begin.position.size(), 0.0)};
      const auto gradient = step.pull(bars.twist);
      for (const GradientStatus& status : gradient.status) {
        EXPECT_EQ(status.flags & (kGradientRefused | kGradientSubgradient), 0U);
        EXPECT_LT(status.forward_residual, 1e-11);
      }
      const auto along = random_numbers(heap.begin.twist.size(), 2);
      const auto difference = [&](const auto& moved) { return (moved(kStep) - moved(-kStep)) / (2 * kStep); };
      const double by_twist = difference([&](double size) {
        Begin at = heap.begin;
        for (std::size_t i = 0; i < along.size(); ++i) at.twist[i] += size * along[i];
        return loss(heap.description, Heap::kEnvs, options, at, bars);
      });
      EXPECT_LT(relative_error(by_twist, gradient.twist, along), 1e-6);
      std::vector<double> push = along;
      for (double& number : push) number *= 100;
      const double by_wrench = difference([&](double size) {
        Begin at = heap.begin;
        for (std::size_t i = 0; i < push.size(); ++i) at.wrench[i] += size * push[i];
        return loss(heap.description, Heap::kEnvs, options, at, bars);
      });
      EXPECT_LT(relative_error(by_wrench, gradient.wrench, push), 1e-6);
      for (std::size_t shape = 0; shape < heap.description.shapes.size(); ++shape) {
        const double by_friction = difference([&](double size) {
          WorldDescription changed = heap.description;
          changed.shapes[shape].mu += size;
          return loss(changed, Heap::kEnvs, options, heap.begin, bars);
        });
        double sum = 0.0, terms = 1e-9;
        for (std::size_t env = 0; env < static_cast<std::size_t>(Heap::kEnvs); ++env) {
          sum += gradient.friction[env * heap.description.shapes.size() + shape];
          terms += std::abs(gradient.friction[env * heap.description.shapes.size() + shape]);
        }
        EXPECT_LT(std::abs(by_friction - sum) / terms, 1e-5) << "shape " << shape;
      }
    }
}

/// Only the depth of a ball on a plane without friction counts, and so all of the step is differentiated.
TEST(WorldDerivative, ByPositionIsExactWhereDepthsAreAll) {
  WorldDescription description;
  add_floor(description, 0.0);
  for (int ball = 0; ball < 3; ++ball) add_body(description, ShapeKind::sphere, {0.1, 0, 0}, 0.5);
  Begin begin;
  for (int ball = 0; ball < 3; ++ball) {
    const double over[] = {2e-4, -1e-3, -5e-3};
    begin.position.insert(begin.position.end(), {1.0 * ball, 0, 0.1 - over[ball]});
    begin.orientation.insert(begin.orientation.end(), {1, 0, 0, 0});
    begin.twist.insert(begin.twist.end(), {0.5, -0.2, -2.0, 1.0, 2.0, 0.3});
  }
  begin.wrench.assign(18, 0.0);
  const WorldOptions options = exact(Law::coulomb);
  World<double> world = started(description, 1, options, begin);
  const WorldStep<double> step(world);
  EXPECT_EQ(world.contact_offsets()[1], 3);
  const Bars bars{random_numbers(18, 1), random_numbers(9, 2)};
  const auto gradient = step.pull(bars.twist, bars.position);
  EXPECT_EQ(gradient.status[0].flags, 0U);
  for (std::size_t k = 0; k < 9; ++k) {
    constexpr double kStep = 1e-7;
    Begin up = begin, down = begin;
    up.position[k] += kStep;
    down.position[k] -= kStep;
    const double difference =
        (loss(description, 1, options, up, bars) - loss(description, 1, options, down, bars)) / (2 * kStep);
    EXPECT_NEAR(gradient.position[k], difference, 1e-5 * (1 + std::abs(difference))) << k;
  }
}

/// A brick that tumbles in the air: no contact, and a spin that keeps its momentum.
TEST(WorldDerivative, KnowsTheGyroscopicTerm) {
  WorldDescription description;
  add_body(description, ShapeKind::box, {0.1, 0.2, 0.3});
  Begin begin{{0, 0, 5}, {0.5, 0.5, -0.5, 0.5}, {0, 0, 0, 8, -5, 11}, {0, 0, 0, 0.1, 0, 0}};
  WorldOptions options = exact(Law::coulomb);
  options.stepping.dt = 0.05;
  World<double> world = started(description, 1, options, begin);
  const WorldStep<double> step(world);
  const Bars bars{{0, 0, 0, 0.3, -0.7, 0.4}, {0, 0, 0}};
  const auto gradient = step.pull(bars.twist);
  for (std::size_t k = 0; k < 6; ++k) {
    constexpr double kStep = 1e-6;
    Begin up = begin, down = begin;
    up.twist[k] += kStep;
    down.twist[k] -= kStep;
    EXPECT_NEAR(gradient.twist[k],
                (loss(description, 1, options, up, bars) - loss(description, 1, options, down, bars)) / (2 * kStep),
                1e-8)
        << k;
  }
}

TEST(WorldDerivative, APoisonedEnvironmentGetsZerosAndLeavesOthersAlone) {
  const Heap heap(0.0);
  const auto pulled = [&](bool poisoned) {
    World<double> world = started(heap.description, Heap::kEnvs, exact(Law::coulomb), heap.begin);
    if (poisoned) world.wrench()[24 * 3] = std::numeric_limits<double>::quiet_NaN();
    const WorldStep<double> step(world);
    return step.pull(random_numbers(heap.begin.twist.size(), 1));
  };
  const auto sound = pulled(false), poisoned = pulled(true);
  EXPECT_NE(poisoned.status[3].flags & kGradientInvalidInput, 0U);
  for (std::size_t i = 0; i < sound.twist.size(); ++i) {
    EXPECT_EQ(poisoned.twist[i], i / 24 == 3 ? 0.0 : sound.twist[i]);
    EXPECT_EQ(poisoned.wrench[i], i / 24 == 3 ? 0.0 : sound.wrench[i]);
  }
}

TEST(WorldDerivative, HasTheSameBitsForWorldsOfADeviceAndAnyThreads) {
  const Heap heap(0.6);
  const auto pulled = [&](Device device, int threads) {
    WorldOptions options = exact(Law::coulomb);
    options.solver.tolerance = 1e-6;
    World<float> world(device, heap.description, Heap::kEnvs, options);
    const auto floats = [](const std::vector<double>& from) { return std::vector<float>(from.begin(), from.end()); };
    const auto position = floats(heap.begin.position), orientation = floats(heap.begin.orientation),
               twist = floats(heap.begin.twist), wrench = floats(heap.begin.wrench);
    world.reset(std::vector<std::uint8_t>(Heap::kEnvs, 1), WorldState<float>{position, orientation, twist});
    std::copy(wrench.begin(), wrench.end(), world.wrench().begin());
    DerivativeOptions derivative;
    derivative.threads = threads;
    WorldStep<float> step(world, derivative);
    return step.pull(random_numbers<float>(heap.begin.twist.size(), 1),
                     random_numbers<float>(heap.begin.position.size(), 2));
  };
  const auto expected = pulled(Device::cpu(), 1);
  EXPECT_NE(expected.wrench, std::vector<float>(expected.wrench.size()));
  for (const auto& own : {pulled(Device::cpu(), 2), pulled(Device::emulated(), 1)}) {
    EXPECT_EQ(own.twist, expected.twist);
    EXPECT_EQ(own.wrench, expected.wrench);
    EXPECT_EQ(own.position, expected.position);
    EXPECT_EQ(own.friction, expected.friction);
    EXPECT_EQ(own.depth, expected.depth);
  }
}

TEST(WorldDerivative, RefusesWhatItCannotDo) {
  WorldDescription description;
  add_floor(description);
  WorldOptions options;
  options.solver.max_contacts_per_env = 4;
  World<float> limited(Device::cpu(), description, 1, options);
  EXPECT_NE(error_message([&] { WorldStep<float>{limited}; }).find("max_contacts_per_env"), std::string::npos);
  options.solver.max_contacts_per_env = 0;
  World<float> world(Device::cpu(), description, 2, options);
  const WorldStep<float> step(world);
  EXPECT_NE(error_message([&] { static_cast<void>(step.pull(std::vector<float>(5))); }).find("twist"),
            std::string::npos);
  EXPECT_EQ(step.pull(std::vector<float>{}).status.size(), 2U);
}

}  // namespace
